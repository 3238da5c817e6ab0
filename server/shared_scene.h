// A scene on the device with its lights: uploaded once, referenced by every session that streams it.
#pragma once

#include <memory>

#include "gpu/device.h"
#include "scene/gpu_scene.h"
#include "shading/gather_choice.h"
#include "shading/lighting.h"

namespace tessera::server {

class SharedScene {
 public:
  static StatusOr<std::shared_ptr<SharedScene>> create(
      std::shared_ptr<gpu::Device> device, std::shared_ptr<const scene::Scene> scene,
      const shading::LightingSettings& lighting = {},
      shading::GatherPath gather = shading::GatherPath::automatic);

  gpu::Device& device() { return *device_; }
  const scene::Scene& scene() const { return gpu_scene_->scene(); }
  const scene::GpuScene& gpu_scene() const { return *gpu_scene_; }
  shading::Lighting& lighting() { return *lighting_; }
  // Of every session. Automatic: measured at creation on the device, with the scene's materials and lights;
  // on a software device the shipped one, so that runs repeat to the bit and start without a wait.
  const shading::GatherChoice& gather_choice() const { return gather_choice_; }

 private:
  SharedScene() = default;
  Status choose_gather_paths(shading::GatherPath gather);
  std::shared_ptr<gpu::Device> device_;
  std::unique_ptr<scene::GpuScene> gpu_scene_;
  std::unique_ptr<shading::Lighting> lighting_;
  shading::GatherChoice gather_choice_ = shading::software_choice();
};

}  // namespace tessera::server
