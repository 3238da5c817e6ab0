#include "server/shared_scene.h"

#include "base/log.h"
#include "shading/gather_cost.h"

namespace tessera::server {

StatusOr<std::shared_ptr<SharedScene>> SharedScene::create(std::shared_ptr<gpu::Device> device,
                                                           std::shared_ptr<const scene::Scene> scene,
                                                           const shading::LightingSettings& lighting,
                                                           shading::GatherPath gather) {
  std::shared_ptr<SharedScene> shared(new SharedScene);
  shared->device_ = std::move(device);
  TESSERA_ASSIGN_OR_RETURN(shared->gpu_scene_, scene::GpuScene::create(*shared->device_, std::move(scene)));
  TESSERA_ASSIGN_OR_RETURN(shared->lighting_,
                           shading::Lighting::create(*shared->device_, *shared->gpu_scene_, lighting));
  TESSERA_RETURN_IF_ERROR(shared->choose_gather_paths(gather));
  return shared;
}

Status SharedScene::choose_gather_paths(shading::GatherPath gather) {
  const gpu::DeviceInfo& info = device_->info();
  const bool measures = gather == shading::GatherPath::automatic && !info.software;
  if (gather != shading::GatherPath::automatic) gather_choice_ = shading::only(gather);
  if (measures) {
    TESSERA_ASSIGN_OR_RETURN(const auto instant, scene::SceneInstant::create(*device_, *gpu_scene_));
    instant->set(0, scene().world_bounds(0).center());
    TESSERA_RETURN_IF_ERROR(lighting_->update(*instant));
    TESSERA_ASSIGN_OR_RETURN(const shading::GatherCosts costs,
                             shading::measure_gather_costs(*device_, *gpu_scene_, *instant, *lighting_));
    gather_choice_ = shading::cheapest(costs);
  }
  log_event(spdlog::level::info, "gather paths",
            {{"scene", scene().name},
             {"device", info.name},
             {"measured", measures ? "yes" : "no"},
             {"paths", shading::to_text(gather_choice_)}});
  return absl::OkStatus();
}

}  // namespace tessera::server
