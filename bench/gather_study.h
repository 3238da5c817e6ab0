// What a shaded sample costs (experiment E7): each way of arranging samples in the atlas, on each path of the
// gather, and texel shading, against forward shading in the same run.
//
// Forward shading is the reference renderer with one sample a pixel. Its time is that of its depth pass and
// of its shading pass, per pixel that geometry covers; the copy of the picture is not counted. Shadow maps
// are drawn before and count for nobody. A gather's time is its device interval: work lists are made on the
// CPU before. A sample is a texel that is filled: tessellation shades one that lies twice in an L once. All
// shade the same surfaces: shapes are given to triangles in proportion to the pixels that show them, but for
// masked materials, which have another cost (coverage) in the atlas.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "bench/progress.h"
#include "bench/result.h"
#include "bench/settings.h"
#include "shading/gather_cost.h"

namespace tessera::bench {

struct GatherStudySettings {
  LoopbackSettings common;          // scene, path, start, size, fov-y, device, json, report
  uint32_t samples = 500'000;       // a row, about
  uint32_t rounds = 7;              // one more warms up
  uint32_t texture_mtexels = 16;    // texel shading: of its unique texture's finest level, Mi texels
  std::vector<std::string> groups;  // names of kinds of rows to measure; none: all
  GatherStudySettings();
};

constexpr std::string_view kGatherGroups[] = {"blocks", "l", "halves", "layouts", "texels", "costs"};

// Over the rounds.
struct Spread {
  double median = 0, low = 0, high = 0;  // quartiles
};
Spread spread_of(std::vector<double> values);

struct GatherRow {
  std::string group, name;  // "blocks", "16x16"
  std::string path;         // name_of(GatherPath), or "compute" of texel shading
  double size = 0;          // side, level, or intervals across
  double slant = 0;         // halves: base to height
  uint64_t samples = 0;     // shaded
  Spread ns;                // a sample
  Spread ratio;  // to forward shading, depth and shading pass, in the same round, just before and after
  Spread ratio_shading;           // to its shading pass alone
  Spread list_ms;                 // the CPU's work lists for all of the load; none for texel shading
  std::optional<double> outside;  // halves: share of the samples outside their triangles
  std::optional<double> empty;    // texel shading: share of its tiles' texels that show nothing
};

struct GatherStudyResult {
  GatherStudySettings settings;
  std::string command;
  DeviceDescription device;
  double covered = 0, masked = 0;  // shares of the picture's pixels: geometry, masked geometry
  Spread forward_ns, shading_ns;   // forward: a covered pixel, both passes, shading alone
  std::vector<GatherRow> rows;
  // Texel shading of the whole picture: tiles, and samples of them that show something.
  uint64_t texel_tiles = 0, texel_samples = 0;
  double texels_per_metre = 0;
  // The cost model of GatherPath::automatic, as measured here.
  shading::GatherCosts costs;
  std::string measured_choice, software_choice;
  double costs_ms = 0;  // how long measuring took, after pipelines are warm
};

nlohmann::json to_json(const GatherStudyResult& result);
std::string to_text(const GatherStudyResult& result);

// Adds the options of `gather`. `settings` must outlive the parse, and gives the defaults.
void add_options(CLI::App& app, GatherStudySettings& settings);
std::vector<std::string> to_flags(const GatherStudySettings& settings);

StatusOr<GatherStudyResult> run_gather_study(const GatherStudySettings& settings, Progress& progress);

// A self-contained page, and the result as JSON, in `folder`.
Status write_gather_report(const std::string& folder, const GatherStudyResult& result);

}  // namespace tessera::bench
