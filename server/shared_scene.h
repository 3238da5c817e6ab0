// A scene on the device with its lights: uploaded once, referenced by every session that streams it.
#pragma once

#include <memory>

#include "gpu/device.h"
#include "scene/gpu_scene.h"
#include "shading/lighting.h"

namespace tessera::server {

class SharedScene {
 public:
  static StatusOr<std::shared_ptr<SharedScene>> create(std::shared_ptr<gpu::Device> device,
                                                       std::shared_ptr<const scene::Scene> scene,
                                                       const shading::LightingSettings& lighting = {});

  gpu::Device& device() { return *device_; }
  const scene::Scene& scene() const { return gpu_scene_->scene(); }
  const scene::GpuScene& gpu_scene() const { return *gpu_scene_; }
  shading::Lighting& lighting() { return *lighting_; }

 private:
  SharedScene() = default;
  std::shared_ptr<gpu::Device> device_;
  std::unique_ptr<scene::GpuScene> gpu_scene_;
  std::unique_ptr<shading::Lighting> lighting_;
};

}  // namespace tessera::server
