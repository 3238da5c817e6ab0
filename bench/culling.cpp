#include "bench/culling.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>

#include "base/camera_path.h"
#include "bench/path_views.h"
#include "bench/streamer.h"
#include "pvs/visibility.h"
#include "scene/gltf.h"
#include "scene/procedural.h"

namespace tessera::bench {
namespace {

// Patches in only one of the two. What both see has the same footprint: it depends on the eye alone.
size_t count_differing(const scene::VisiblePatches& a, const scene::VisiblePatches& b) {
  std::vector<scene::VisiblePatch> differing;
  std::ranges::set_symmetric_difference(a, b, std::back_inserter(differing), {}, &scene::VisiblePatch::patch,
                                        &scene::VisiblePatch::patch);
  return differing.size();
}

struct Study {
  const LoopbackSettings& settings;
  const CameraPath& path;
  std::unique_ptr<scene::SceneInstant> instant;
  std::unique_ptr<pvs::Visibility> culled, all;

  StatusOr<CullingFrame> measure(double path_s) const;
};

StatusOr<CullingFrame> Study::measure(double path_s) const {
  const PathViews seen_from = path_views(settings, path, path_s);
  const std::vector<View>& views = seen_from.views;
  const View client = client_view(settings);
  instant->set(seen_from.newest.time_ns, seen_from.newest.pose.position);

  CullingFrame frame{.path_s = path_s};
  TESSERA_ASSIGN_OR_RETURN(const scene::VisiblePatches seen, culled->determine(*instant, views, client));
  frame.culled_ms = culled->stats().gpu_ms;
  frame.culled_triangles = culled->stats().triangles_drawn;
  TESSERA_ASSIGN_OR_RETURN(const scene::VisiblePatches wanted, all->determine(*instant, views, client));
  frame.all_ms = all->stats().gpu_ms;
  frame.all_triangles = all->stats().triangles_drawn;
  frame.patches = seen.size();
  frame.differing_patches = count_differing(seen, wanted);
  return frame;
}

nlohmann::json to_json(const CullingFrame& f) {
  return {{"path_s", f.path_s},
          {"culled_ms", f.culled_ms},
          {"all_ms", f.all_ms},
          {"ratio", f.ratio()},
          {"culled_triangles", f.culled_triangles},
          {"all_triangles", f.all_triangles},
          {"patches", f.patches},
          {"differing_patches", f.differing_patches}};
}

}  // namespace

Percentiles CullingResult::ratio() const {
  std::vector<double> ratios;
  for (const CullingFrame& frame : frames) ratios.push_back(frame.ratio());
  return percentiles(std::move(ratios));
}

size_t CullingResult::differing_patches() const {
  size_t sum = 0;
  for (const CullingFrame& frame : frames) sum += frame.differing_patches;
  return sum;
}

nlohmann::json to_json(const CullingResult& result) {
  nlohmann::json frames = nlohmann::json::array();
  for (const CullingFrame& frame : result.frames) frames.push_back(to_json(frame));
  const Percentiles ratio = result.ratio();
  nlohmann::json run = run_json(result.command, result.device, result.settings);
  run["rows"] = {{{"ratio", {{"p50", ratio.p50}, {"p95", ratio.p95}, {"p99", ratio.p99}}},
                  {"differing_patches", result.differing_patches()}}};
  run["frames"] = frames;
  return run;
}

std::vector<std::string> culling_options() {
  return {"scene", "path",   "start",    "seconds", "fps",        "size",
          "fov-y", "device", "delay-ms", "pvs",     "server-fps", "json"};
}

StatusOr<CullingResult> run_culling(const LoopbackSettings& settings, Progress& progress) {
  TESSERA_ASSIGN_OR_RETURN(const std::shared_ptr<gpu::Device> device,
                           gpu::Device::create({.select = settings.device}));
  TESSERA_ASSIGN_OR_RETURN(const std::shared_ptr<const scene::Scene> scene,
                           scene::load_scene(settings.scene));
  TESSERA_ASSIGN_OR_RETURN(const CameraPath path, scene::load_path(settings.path));
  TESSERA_ASSIGN_OR_RETURN(const auto gpu_scene, scene::GpuScene::create(*device, scene));
  Study study{.settings = settings, .path = path};
  TESSERA_ASSIGN_OR_RETURN(study.instant, scene::SceneInstant::create(*device, *gpu_scene));
  TESSERA_ASSIGN_OR_RETURN(study.culled, pvs::Visibility::create(*device, *gpu_scene, {}));
  TESSERA_ASSIGN_OR_RETURN(
      study.all,
      pvs::Visibility::create(*device, *gpu_scene, {.frustum_culling = false, .occlusion_culling = false}));

  CullingResult result{.settings = settings};
  result.device = {device->info().name, device->info().driver, device->info().software};
  const auto frames =
      static_cast<uint64_t>(std::max(1L, std::lround(settings.seconds * settings.server_fps)));
  progress.begin("server frames", frames);
  for (uint64_t i = 0; i < frames; ++i) {
    const double path_s = settings.start_s + static_cast<double>(i) / settings.server_fps;
    TESSERA_ASSIGN_OR_RETURN(CullingFrame frame, study.measure(path_s));
    result.frames.push_back(frame);
    progress.advance();
  }
  return result;
}

}  // namespace tessera::bench
