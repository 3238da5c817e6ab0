#include "bench/spatial.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "bench/image_io.h"
#include "bench/shading_streamer.h"
#include "bench/study_scene.h"
#include "pvs/visibility.h"

namespace tessera::bench {
namespace {

constexpr double kCenterDegrees = 5;

std::vector<Eye> eyes_of(const SpatialSettings& settings, const SpatialCase& method) {
  const Fov fov = client_view(settings.common).fov;
  if (!method.stereo) return {{.fov = fov}};
  const double half_m = 0.5e-3 * settings.eye_distance_mm;
  return {{.in_head = {.position = {-half_m, 0, 0}}, .fov = fov},
          {.in_head = {.position = {half_m, 0, 0}}, .fov = fov}};
}

server::SessionSettings session_of(const SpatialSettings& settings, const SpatialCase& method) {
  server::SessionSettings session = session_settings(settings.common);
  session.eyes = eyes_of(settings, method);
  session.density = method.density;
  // Nothing travels: what the pose shows is all that is needed.
  session.prediction.mode = pvs::PredictionMode::none;
  atlas::LevelSettings& levels = session.layout.levels;
  if (method.bias) levels.min_bias = levels.max_bias = *method.bias;
  return session;
}

// The mean of a map within an angle of the middle of a picture.
double mean_near_center(const Plane& plane, const View& view) {
  const double limit = std::cos(kCenterDegrees * 3.14159265358979323846 / 180);
  double sum = 0;
  uint64_t count = 0;
  for (uint32_t y = 0; y < plane.height; ++y) {
    const double up = view.fov.up + (view.fov.down - view.fov.up) * (y + 0.5) / plane.height;
    for (uint32_t x = 0; x < plane.width; ++x) {
      const double right = view.fov.left + (view.fov.right - view.fov.left) * (x + 0.5) / plane.width;
      if (1 / std::sqrt(1 + up * up + right * right) < limit) continue;
      sum += plane.row(y)[x];
      ++count;
    }
  }
  return count ? sum / static_cast<double>(count) : 1;
}

// Everything of one run; measures one case after the other.
class Study {
 public:
  Study(const SpatialSettings& settings, Progress& progress) : settings_(settings), progress_(progress) {}
  StatusOr<SpatialResult> run();

 private:
  Status set_up();
  Status measure(const SpatialCase& method);
  Status frame(const SpatialCase& method, ShadingStreamer& streamer, uint32_t index, SpatialRow& row);
  Status look(const SpatialCase& method, ShadingStreamer& streamer, uint32_t index, const Pose& pose,
              SpatialRow& row);
  Plane samples_per_pixel(ShadingStreamer& streamer, const shading::ReferenceImage& truth,
                          const View& view) const;
  double holes(ShadingStreamer& streamer, const shading::ReferenceImage& truth) const;
  const SpatialRow* mono_like(const SpatialCase& method) const;

  TimeNs time_of(uint32_t index) const {
    return from_seconds(settings_.common.start_s + index / settings_.common.server_fps);
  }

  const SpatialSettings settings_;
  Progress& progress_;
  SpatialResult result_;
  std::optional<StudyScene> on_;
  std::unique_ptr<TruthSource> truth_;
  std::optional<pvs::TriangleToPatch> patch_of_;
};

Status Study::set_up() {
  const LoopbackSettings& common = settings_.common;
  TESSERA_ASSIGN_OR_RETURN(StudyScene on, load_study_scene(common));
  on_.emplace(std::move(on));
  TESSERA_ASSIGN_OR_RETURN(truth_, on_->truth(common));
  patch_of_.emplace(*on_->scene);
  result_.settings = settings_;
  result_.device = on_->description();
  result_.frames = static_cast<uint32_t>(std::max(1L, std::lround(common.seconds * common.server_fps)));
  return absl::OkStatus();
}

double Study::holes(ShadingStreamer& streamer, const shading::ReferenceImage& truth) const {
  return hole_share(truth.triangle_plus_one, truth.covered,
                    [&](uint32_t triangle) { return streamer.has_patch((*patch_of_)[triangle]); });
}

// A patch's texels over the pixels that it would fill if nothing hid it.
Plane Study::samples_per_pixel(ShadingStreamer& streamer, const shading::ReferenceImage& truth,
                               const View& view) const {
  Plane density(truth.color.width, truth.color.height);
  const std::span<const atlas::Placement> placements = streamer.session().placements();
  const std::vector<dmat4>& transforms = truth_->instant().instance_transforms();
  const auto of_patch = [&](scene::PatchId patch) {
    const auto placed = std::ranges::equal_range(placements, patch, {}, &atlas::Placement::patch);
    uint64_t texels = 0;
    for (const atlas::Placement& p : placed) texels += p.color_texels();
    if (texels == 0) return 0.0f;
    const uint32_t i = on_->scene->instance_of(patch);
    const scene::Instance& instance = on_->scene->instances[i];
    const scene::Geometry& geometry = on_->scene->geometries[instance.geometry];
    const scene::Footprint size = pvs::footprint(geometry, geometry.patches[patch - instance.first_patch],
                                                 transforms[i], view.pose.position, view.pixels_per_radian());
    return static_cast<float>(texels) / std::max(size.area_px2, 1e-3f);
  };
  scene::PatchId last = scene::kNone;
  float value = 0;
  for (size_t i = 0; i < truth.triangle_plus_one.size(); ++i) {
    if (truth.triangle_plus_one[i] == 0) continue;
    const scene::PatchId patch = (*patch_of_)[truth.triangle_plus_one[i] - 1];
    if (patch != last) value = of_patch(last = patch);
    density.values[i] = value;
  }
  return density;
}

// Through each eye, with the atlas that the frame left.
Status Study::look(const SpatialCase& method, ShadingStreamer& streamer, uint32_t index, const Pose& pose,
                   SpatialRow& row) {
  const std::vector<Eye> eyes = eyes_of(settings_, method);
  const double share = 1.0 / (static_cast<double>(eyes.size()) * result_.frames);
  for (size_t e = 0; e < eyes.size(); ++e) {
    View view = client_view(settings_.common);
    view.fov = eyes[e].fov;
    view.pose = compose(pose, eyes[e].in_head);
    TESSERA_ASSIGN_OR_RETURN(const RenderedImage truth, truth_->truth(view, time_of(index)));
    TESSERA_ASSIGN_OR_RETURN(Image8 shown, streamer.draw_uncoded(view));
    const Comparison c = compare_images(truth->color, shown);
    row.mssim += share * c.error.mssim;
    row.mssim_center += share * mean_near_center(c.ssim, view);
    row.holes += share * holes(streamer, *truth);
    if (index != result_.frames / 2) continue;
    const char* eye = !method.stereo ? "" : e == 0 ? ", left eye" : ", right eye";
    result_.pictures.push_back({method.name + ", bias " + method.bias_name() + eye, c.error.mssim,
                                truth->color, std::move(shown), dssim_picture(c.ssim),
                                density_picture(samples_per_pixel(streamer, *truth, view))});
  }
  return absl::OkStatus();
}

Status Study::frame(const SpatialCase& method, ShadingStreamer& streamer, uint32_t index, SpatialRow& row) {
  const TimedPose pose{time_of(index), on_->path.at(time_of(index))};
  TESSERA_ASSIGN_OR_RETURN(
      const std::vector<Packet> packets,
      streamer.serve({.number = index, .poses = std::span(&pose, 1), .scene_time_ns = pose.time_ns}));
  for (const Packet& packet : packets)
    TESSERA_RETURN_IF_ERROR(streamer.deliver(packet.channel, packet.bytes));
  if (streamer.newest_frame() != index)
    return absl::InternalError(absl::StrCat("frame ", index, " did not come out whole"));

  const server::FrameStats& stats = streamer.last_stats();
  const double share = 1.0 / result_.frames;
  row.samples += share * static_cast<double>(stats.gather.samples);
  row.color_samples += share * static_cast<double>(stats.gather.color_samples);
  row.bias += share * stats.layout.bias;
  row.out_of_memory += share * stats.layout.colors_out_of_memory;
  row.visibility_ms += share * stats.times.visibility_ms;
  row.density_ms += share * stats.times.density_ms;
  row.layout_ms += share * stats.times.layout_ms;
  row.shading_ms += share * stats.times.shading_ms;
  return look(method, streamer, index, pose.pose, row);
}

// Null: not measured yet, so it is this one.
const SpatialRow* Study::mono_like(const SpatialCase& method) const {
  for (const SpatialRow& row : result_.rows) {
    if (row.method.name == "mono" && row.method.bias.has_value() == method.bias.has_value()) return &row;
  }
  return nullptr;
}

Status Study::measure(const SpatialCase& method) {
  TESSERA_ASSIGN_OR_RETURN(const auto streamer, ShadingStreamer::create(on_->shared, settings_.common,
                                                                        session_of(settings_, method)));
  SpatialRow row{.method = method};
  for (uint32_t i = 0; i < result_.frames; ++i) {
    TESSERA_RETURN_IF_ERROR(frame(method, *streamer, i, row));
    progress_.advance();
  }
  const Size& size = settings_.common.size;
  row.per_pixel = row.samples / (static_cast<double>(size.width) * size.height);
  const SpatialRow* mono = mono_like(method);
  row.to_mono = mono ? row.samples / mono->samples : 1;
  result_.rows.push_back(std::move(row));
  return absl::OkStatus();
}

StatusOr<SpatialResult> Study::run() {
  TESSERA_RETURN_IF_ERROR(set_up());
  std::vector<SpatialCase> cases = spatial_cases();
  const std::vector<std::string>& wanted = settings_.methods;
  std::erase_if(cases, [&](const SpatialCase& method) {
    return !wanted.empty() && std::ranges::find(wanted, method.name) == wanted.end();
  });
  progress_.begin("frames", cases.size() * result_.frames);
  for (const SpatialCase& method : cases) TESSERA_RETURN_IF_ERROR(measure(method));
  return std::move(result_);
}

nlohmann::json to_json(const SpatialRow& row) {
  return {{"method", row.method.name},
          {"bias_mode", row.method.bias_name()},
          {"eyes", row.method.stereo ? 2 : 1},
          {"samples", row.samples},
          {"color_samples", row.color_samples},
          {"samples_per_pixel", row.per_pixel},
          {"samples_to_mono", row.to_mono},
          {"bias", row.bias},
          {"mssim", row.mssim},
          {"mssim_center", row.mssim_center},
          {"holes", row.holes},
          {"patches_out_of_memory", row.out_of_memory},
          {"ms",
           {{"visibility", row.visibility_ms},
            {"density", row.density_ms},
            {"layout", row.layout_ms},
            {"shading", row.shading_ms}}}};
}

}  // namespace

std::string SpatialCase::bias_name() const {
  if (!bias) return "by atlas";
  return *bias == 0 ? "off" : absl::StrFormat("%g", *bias);
}

// Mono first: others are compared with it.
std::vector<SpatialCase> spatial_cases() {
  std::vector<SpatialCase> cases;
  for (const std::optional<float> bias : {std::optional<float>(0.0f), std::optional<float>()}) {
    cases.push_back({.name = "mono", .bias = bias});
    cases.push_back({.name = "stereo", .bias = bias, .stereo = true});
    cases.push_back({.name = "foveated", .bias = bias, .density = {.foveation = 1}});
    cases.push_back({.name = "foveated x2", .bias = bias, .density = {.foveation = 2}});
    cases.push_back({.name = "barrel", .bias = bias, .density = {.barrel = true}});
    cases.push_back({.name = "stereo foveated", .bias = bias, .stereo = true, .density = {.foveation = 1}});
  }
  for (const float bias : {1.0f, 2.0f}) cases.push_back({.name = "upsampled", .bias = bias});
  return cases;
}

SpatialSettings default_spatial_settings() {
  SpatialSettings settings;
  settings.common.size = {1920, 1080};
  settings.common.atlas = {4096, 2048};
  settings.common.server_fps = 1;
  settings.common.split = true;  // pictures without coding
  return settings;
}

std::vector<std::string> spatial_options() {
  return {"scene",  "path",       "start",  "seconds", "size",        "fov-y", "atlas",
          "layout", "server-fps", "device", "truth",   "truth-cache", "json",  "report"};
}

nlohmann::json to_json(const SpatialResult& result) {
  nlohmann::json run = run_json(result.command, result.device, result.settings.common);
  run["schema"] = "tessera.bench.spatial.v1";
  run["settings"]["eye-distance-mm"] = result.settings.eye_distance_mm;
  run["frames"] = result.frames;
  run["rows"] = nlohmann::json::array();
  for (const SpatialRow& row : result.rows) run["rows"].push_back(to_json(row));
  return run;
}

StatusOr<SpatialResult> run_spatial(const SpatialSettings& settings, Progress& progress) {
  return Study(settings, progress).run();
}

}  // namespace tessera::bench
