#include "bench/study_scene.h"

#include "scene/procedural.h"

namespace tessera::bench {

DeviceDescription StudyScene::description() const {
  return {device->info().name, device->info().driver, device->info().software};
}

StatusOr<std::unique_ptr<TruthSource>> StudyScene::truth(const LoopbackSettings& settings) const {
  return TruthSource::create(shared, settings.scene, settings.truth_cache,
                             settings.truth == Truth::one ? 1 : 4);
}

StatusOr<StudyScene> load_study_scene(const LoopbackSettings& settings) {
  TESSERA_ASSIGN_OR_RETURN(
      const std::shared_ptr<gpu::Device> device,
      gpu::Device::create({.select = settings.device, .validation = settings.validation}));
  TESSERA_ASSIGN_OR_RETURN(const std::shared_ptr<const scene::Scene> scene,
                           scene::load_scene(settings.scene));
  TESSERA_ASSIGN_OR_RETURN(CameraPath path, scene::load_path(settings.path));
  TESSERA_ASSIGN_OR_RETURN(auto shared, server::SharedScene::create(device, scene, {}, settings.gather));
  return StudyScene{device, scene, std::move(shared), std::move(path)};
}

}  // namespace tessera::bench
