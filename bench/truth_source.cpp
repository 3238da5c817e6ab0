#include "bench/truth_source.h"

#include "bench/version.h"

namespace tessera::bench {
namespace {

// Another driver may round differently.
std::string renderer_identity(const gpu::DeviceInfo& device) {
  return absl::StrCat(kRendererSources, " ", device.name, " ", device.driver);
}

}  // namespace

StatusOr<std::unique_ptr<TruthSource>> TruthSource::create(std::shared_ptr<server::SharedScene> scene,
                                                           const std::string& scene_spec,
                                                           const std::string& cache_dir, uint32_t samples) {
  std::unique_ptr<TruthSource> source(new TruthSource);
  gpu::Device& device = scene->device();
  TESSERA_ASSIGN_OR_RETURN(source->instant_, scene::SceneInstant::create(device, scene->gpu_scene()));
  TESSERA_ASSIGN_OR_RETURN(source->renderer_,
                           shading::ReferenceRenderer::create(device, scene->gpu_scene(), scene->lighting()));
  if (cache_dir == "none") {
    source->cache_ = std::make_unique<TruthCache>();
  } else {
    const std::filesystem::path folder =
        cache_dir.empty() ? default_truth_cache() : std::filesystem::path(cache_dir);
    TESSERA_ASSIGN_OR_RETURN(source->cache_, TruthCache::open(folder));
  }
  source->identity_ = scene_identity(scene_spec);
  source->samples_ = samples;
  source->scene_ = std::move(scene);
  return source;
}

StatusOr<shading::ReferenceImage> TruthSource::truth(const View& view, TimeNs scene_time_ns) {
  const bool moves = scene_->scene().animation_length_s > 0;
  instant_->set(scene_time_ns, view.pose.position);
  const TruthKey key{.scene = identity_,
                     .renderer = renderer_identity(scene_->device().info()),
                     .scene_time_ns = moves ? scene_time_ns : 0,
                     .view = view,
                     .request = {.samples = samples_, .ids = true}};
  return cache_->get(key, [&] { return render(view, scene_time_ns, key.request); });
}

StatusOr<shading::ReferenceImage> TruthSource::render(const View& view, TimeNs scene_time_ns,
                                                      const shading::ReferenceRequest& request) {
  instant_->set(scene_time_ns, view.pose.position);
  TESSERA_RETURN_IF_ERROR(scene_->lighting().update(*instant_));
  return renderer_->render(*instant_, view, request);
}

}  // namespace tessera::bench
