#include "server/shared_scene.h"

namespace tessera::server {

StatusOr<std::shared_ptr<SharedScene>> SharedScene::create(std::shared_ptr<gpu::Device> device,
                                                           std::shared_ptr<const scene::Scene> scene,
                                                           const shading::LightingSettings& lighting) {
  std::shared_ptr<SharedScene> shared(new SharedScene);
  shared->device_ = std::move(device);
  TESSERA_ASSIGN_OR_RETURN(shared->gpu_scene_, scene::GpuScene::create(*shared->device_, std::move(scene)));
  TESSERA_ASSIGN_OR_RETURN(shared->lighting_,
                           shading::Lighting::create(*shared->device_, *shared->gpu_scene_, lighting));
  return shared;
}

}  // namespace tessera::server
