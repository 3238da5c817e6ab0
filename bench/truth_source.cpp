#include "bench/truth_source.h"

#include "bench/version.h"

namespace tessera::bench {
namespace {

// A pose is on its way to the server for less than this many display and server frames.
constexpr size_t kRecentImages = 32;

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

TruthKey TruthSource::key_of(const View& view, TimeNs scene_time_ns,
                             const shading::ReferenceRequest& request) const {
  const bool moves = scene_->scene().animation_length_s > 0;
  return {.scene = identity_,
          .renderer = renderer_identity(scene_->device().info()),
          .scene_time_ns = moves ? scene_time_ns : 0,
          .view = view,
          .request = request};
}

RenderedImage TruthSource::find_recent(const TruthKey& key) const {
  for (const auto& [held, image] : recent_) {
    if (key.request.ids && !held.request.ids) continue;
    if (key.request.depth && !held.request.depth) continue;
    TruthKey same_planes = held;
    same_planes.request.ids = key.request.ids;
    same_planes.request.depth = key.request.depth;
    if (same_planes.text() == key.text()) return image;
  }
  return nullptr;
}

void TruthSource::keep_recent(const TruthKey& key, const RenderedImage& image) {
  if (recent_.size() == kRecentImages) recent_.pop_front();
  recent_.emplace_back(key, image);
}

StatusOr<RenderedImage> TruthSource::truth(const View& view, TimeNs scene_time_ns) {
  const TruthKey key = key_of(view, scene_time_ns, {.samples = samples_, .ids = true});
  instant_->set(scene_time_ns, view.pose.position);
  TESSERA_ASSIGN_OR_RETURN(RenderedImage image,
                           cache_->get(key, [&] { return render(view, scene_time_ns, key.request); }));
  if (!find_recent(key)) keep_recent(key, image);
  return image;
}

StatusOr<RenderedImage> TruthSource::render(const View& view, TimeNs scene_time_ns,
                                            const shading::ReferenceRequest& request) {
  const TruthKey key = key_of(view, scene_time_ns, request);
  instant_->set(scene_time_ns, view.pose.position);
  if (RenderedImage image = find_recent(key)) return image;
  TESSERA_RETURN_IF_ERROR(scene_->lighting().update(*instant_));
  TESSERA_ASSIGN_OR_RETURN(shading::ReferenceImage rendered, renderer_->render(*instant_, view, request));
  auto image = std::make_shared<const shading::ReferenceImage>(std::move(rendered));
  keep_recent(key, image);
  return image;
}

}  // namespace tessera::bench
