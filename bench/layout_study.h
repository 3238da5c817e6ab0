// What each layout makes of the same path: image error by shaded samples (TSS tables 3, 4), bits by image
// error, and what drawing costs the client. One layout after another streams the same frames over a link
// without loss; the client draws each scored frame at the pose that it has when the frame reaches it. Texel
// shading (bench/texel_shading.h) stands beside them as a baseline, for the same predicted views (but without
// what a session retains of those before).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "bench/progress.h"
#include "bench/result.h"
#include "bench/settings.h"

namespace tessera::bench {

struct LayoutStudySettings {
  LoopbackSettings common;  // see layout_study_options()
  std::vector<std::string> layouts{atlas::kLayoutNames, std::end(atlas::kLayoutNames)};
  std::vector<Size> atlases{{1024, 1024}, {2048, 1024}, {2048, 2048}};
  std::vector<double> bitrates_mbps;  // H.264, atlas and meta together; none: nothing is coded
  double speed = 1;                   // of the path
  uint32_t warm_up_frames = 30;       // not counted: a stream's first pictures are coarse
  uint32_t texture_mtexels = 1024;    // level 0 of texel shading's unique textures, Mi texels
};
LayoutStudySettings default_layout_study_settings();
std::vector<std::string> layout_study_options();

// One layout, atlas size and bit rate. Means over frames after those of the warm-up.
struct LayoutRow {
  std::string layout;
  uint32_t width = 0, height = 0;         // of the atlas
  std::optional<double> bitrate_mbps;     // the limit
  double samples = 0;                     // shaded a frame, for all that may come into view
  double outside_share = 0;               // of them, outside their triangles
  std::optional<double> picture_samples;  // texel shading: those that the very picture reads
  double fill = 0;                        // samples, per texel of the atlas
  double bias = 0;
  double blocks = 0, colors = 0, out_of_memory = 0, changed = 0;  // placements a frame
  ImageError error;                                               // before coding
  std::optional<ImageError> coded;
  double holes = 0;
  double atlas_kbit = 0, meta_kbit = 0;  // a frame
  Percentiles layout_ms, shading_ms;     // of the server
  Percentiles draw_ms;                   // of the client: one picture, with reading it back
};

// A row against another layout. Between the rows of that one its error follows the logarithm of the samples,
// and the logarithm of its bits the error; nothing is said beyond them.
struct LayoutComparison {
  std::string layout, other;
  uint32_t width = 0, height = 0;  // of the row
  std::optional<double> bitrate_mbps;
  std::optional<double> dssim_ratio;  // at the row's samples, before coding: its DSSIM over the other's
  std::optional<double> bits_ratio;   // at the row's coded error and atlas size: its bits over the other's
};
std::vector<LayoutComparison> compare_layouts(const std::vector<LayoutRow>& rows, const std::string& other);

struct LayoutPicture {
  std::string name;  // of the layout and size
  double mssim = 0;
  Image8 truth, shown, dssim, atlas;
};

struct LayoutStudyResult {
  LayoutStudySettings settings;
  std::string command;
  DeviceDescription device;
  uint32_t frames = 0;  // scored
  std::vector<LayoutRow> rows;
  std::vector<LayoutPicture>
      pictures;  // of the first scored frame in the last atlas size; not part of the JSON
};

nlohmann::json to_json(const LayoutStudyResult& result);
std::string to_text(const LayoutStudyResult& result);

StatusOr<LayoutStudyResult> run_layout_study(const LayoutStudySettings& settings, Progress& progress);

// A self-contained page and its pictures as files in `folder`.
Status write_layout_report(const std::string& folder, const LayoutStudyResult& result);

// Of points (x, y), sorted by x: y at x, linear between neighbours; nothing outside.
struct Point {
  double x = 0, y = 0;
};
std::optional<double> interpolate(std::vector<Point> points, double x);

// Adds this command's options.
void add_options(CLI::App& app, LayoutStudySettings& settings);

}  // namespace tessera::bench
