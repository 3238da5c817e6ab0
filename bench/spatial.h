// What spatial reuse of shading saves and costs (thesis ch. 4): stereo from one atlas, foveation, lenses and
// upsampling, each with levels that follow the screen alone (bias off) and with those that follow the room in
// the atlas.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "bench/progress.h"
#include "bench/result.h"
#include "bench/settings.h"
#include "server/frame.h"

namespace tessera::bench {

struct SpatialSettings {
  LoopbackSettings common;  // see spatial_options()
  double eye_distance_mm = 63;
  std::vector<std::string> methods;  // names of cases to measure; none: all
  bool operator==(const SpatialSettings&) const = default;
};
// The thesis' picture, an atlas that holds it without a bias, and a frame a second.
SpatialSettings default_spatial_settings();
// Names of the common options that count here.
std::vector<std::string> spatial_options();

// One way to shade the same path.
struct SpatialCase {
  std::string name;           // "mono", "stereo" …
  std::optional<float> bias;  // none: it follows the room in the atlas
  bool stereo = false;
  atlas::DensitySettings density;

  std::string bias_name() const;
};
std::vector<SpatialCase> spatial_cases();

// Means over the frames; of pictures also over the eyes.
struct SpatialRow {
  SpatialCase method;
  double samples = 0;        // shaded a frame
  double color_samples = 0;  // single colours among them
  double per_pixel = 0;      // samples, per pixel of one eye's picture
  double to_mono = 0;        // samples, per sample of mono with the same bias
  double bias = 0;
  double mssim = 0;          // against the truth of each eye; sampling alone, without coding
  double mssim_center = 0;   // within 5 degrees of the gaze, which is straight ahead
  double holes = 0;          // share of the eyes' pixels without samples
  double out_of_memory = 0;  // patches a frame
  double visibility_ms = 0, density_ms = 0, layout_ms = 0, shading_ms = 0;
};

// One eye's picture of the middle frame.
struct SpatialPicture {
  std::string name;  // of the case, with its bias and eye
  double mssim = 0;
  Image8 truth, shown, dssim;
  Image8 density;  // samples per pixel: see density_picture()
};

struct SpatialResult {
  SpatialSettings settings;
  std::string command;
  DeviceDescription device;
  uint32_t frames = 0;
  std::vector<SpatialRow> rows;
  std::vector<SpatialPicture> pictures;  // not part of the JSON
};
nlohmann::json to_json(const SpatialResult& result);

StatusOr<SpatialResult> run_spatial(const SpatialSettings& settings, Progress& progress);

// Samples per pixel by patch in false colour: black = 1/64 and less, pale yellow = 4 and more, a colour a
// factor. `per_pixel`: 0 for the background.
Image8 density_picture(const Plane& per_pixel);

// A self-contained page and its pictures as files in `folder`.
Status write_spatial_report(const std::string& folder, const SpatialResult& result);

}  // namespace tessera::bench
