// What a run measured, as plain values, and its JSON (`tessera.bench.v1`).
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/frame_record.h"
#include "base/image.h"
#include "base/time.h"
#include "bench/metrics.h"
#include "bench/settings.h"

namespace tessera::bench {

constexpr std::string_view kSchema = "tessera.bench.v1";

struct Percentiles {
  double p50 = 0, p95 = 0, p99 = 0;
};
// Of any values; linear between the two nearest ranks; zeros for none.
Percentiles percentiles(std::vector<double> values);
nlohmann::json to_json(const Percentiles& p);

// Sums up one session, or one baseline. Means are over displayed frames, shares in [0, 1], times in ms. What
// a method does not have is left out of the JSON.
struct Row {
  std::string method;  // "tessera", "mesh-warp", "plain-video"
  uint32_t session = 0;
  std::string note;  // what a reader must know, e.g. "depth is not counted"
  ImageError error;
  std::optional<double> holes, coverage, coverage_without_prediction, overestimation;
  std::optional<double> mssim_masked;  // SSIM within 2 px of masked silhouettes, mean over these pixels
  double mbps_total = 0, mbps_atlas = 0, mbps_meta = 0;
  uint64_t frames_displayed = 0;                    // scored or not
  uint64_t frames_stale = 0;                        // displayed again without a newer pair
  uint64_t frames_lost = 0;                         // sent, never shown
  std::optional<uint64_t> violations;               // of the pairing rules
  std::map<std::string, Percentiles> durations_ms;  // the eight durations by name
  std::optional<Percentiles> end_to_end_ms;
  std::optional<double> tiling_error_ms_max;
  std::optional<Percentiles> overhead_ms;  // FrameDurations::overhead
  std::optional<double>
      first_picture_ms;                 // end to end, of the frame that begins the session; not in the above
  std::optional<double> server_fps;     // by the real clock
  double server_ms = 0, client_ms = 0;  // mean compute time of a frame on this machine
  std::optional<uint64_t> samples_shaded;
  double peak_rss_mib = 0, device_mib = 0;
};

// One rung of the error split: the total error with this cause switched off, or on its own; `added` is what
// the cause adds to 1 - mssim.
struct SplitRow {
  std::string cause;  // "visibility", "sampling", "staleness", "coding", "chroma"
  double mssim = 0, psnr = 0, added = 0;
};

struct DisplayRecord {
  TimeNs time_ns = 0;  // of display, from the start of scoring
  uint32_t frame = 0;  // server frame that was shown
  double age_ms = 0;   // since the pose for which it was made
  double holes = 0;
  uint64_t atlas_bytes = 0, meta_bytes = 0;   // that arrived since the last display frame
  std::map<std::string, double> mssim, psnr;  // by method; empty for a frame that was not scored
};

struct Picture {
  std::string label;  // "first", "middle", "worst", "masked"
  std::string note;   // what the picture and `mssim` are of, if not a whole display frame
  uint64_t display_frame = 0;
  double mssim = 0;
  Image8 truth, shown;
  Plane ssim;
};

struct DeviceDescription {
  std::string name, driver;
  bool software = false;
};

// `frames` and `pictures` are session 0's.
struct LoopbackResult {
  LoopbackSettings settings;
  std::string command;
  DeviceDescription device;
  std::vector<std::string> notes;  // import notes, encoder choice …
  std::string plan;                // frame plan, for people
  std::vector<Row> rows;
  std::vector<SplitRow> split;
  std::vector<DisplayRecord> frames;
  std::vector<FrameRecord> records;  // server frames of all sessions; not part of the JSON
  std::vector<Picture> pictures;     // not part of the JSON
};

nlohmann::json to_json(const LoopbackResult& result);

// The durations of the frames that were shown.
void add_durations(std::span<const FrameRecord> records, Row& row);

// What every run's JSON begins with: how it came about.
nlohmann::json run_json(const std::string& command, const DeviceDescription& device,
                        const LoopbackSettings& settings);
// Processor, cores, memory (MiB), operating system.
nlohmann::json machine_json();
// Peak resident memory of this process so far.
double peak_rss_mib();

}  // namespace tessera::bench
