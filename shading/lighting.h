// Lights and shadow maps of a scene: descriptor set 2 of every shading pass (shading/shaders/lighting.glsl).
#pragma once

#include <memory>

#include "gpu/commands.h"
#include "gpu/device.h"
#include "scene/gpu_scene.h"

namespace tessera::shading {

struct LightingSettings {
  uint32_t sun_shadow_side = 4096;  // texels
  uint32_t spot_shadow_side = 1024;
  uint32_t max_spot_shadows = 4;             // the strongest spots (at most 8); others shine unshadowed
  vec3 ambient_sky{0.30f, 0.33f, 0.38f};     // hemisphere ambient radiance from above …
  vec3 ambient_ground{0.18f, 0.16f, 0.14f};  // … and below
  float exposure = 1.0f;
};

// Shadow maps are drawn once, and again only when something moved (scene features decide whether that can
// happen). A scene without lights of a kind allocates and records nothing for it.
class Lighting {
 public:
  static StatusOr<std::unique_ptr<Lighting>> create(gpu::Device& device, const scene::GpuScene& scene,
                                                    const LightingSettings& settings = {});
  ~Lighting();

  // Writes the lights relative to the instant's origin and draws the shadow maps if they are out of date.
  // Blocks.
  Status update(const scene::SceneInstant& instant);
  const gpu::BindLayout& layout() const;  // set 2
  const gpu::BindGroup& group() const;
  std::vector<gpu::Constant> constants() const;  // light counts, shadow counts
  uint32_t shadow_maps() const;

 private:
  struct Impl;
  explicit Lighting(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::shading
