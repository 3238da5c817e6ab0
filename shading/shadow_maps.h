// The depth images of the sun and the strongest spots, and the pass that draws them.
#pragma once

#include <memory>
#include <vector>

#include "gpu/image.h"
#include "gpu/pipeline.h"
#include "scene/gpu_scene.h"
#include "shading/light_list.h"
#include "shading/shadow_fit.h"

namespace tessera::shading {

struct ShadowMapSettings {
  uint32_t sun_side = 0, spot_side = 0;  // texels
};

// Without lights of a kind its map is one texel and nothing is drawn.
class ShadowMaps {
 public:
  static StatusOr<std::unique_ptr<ShadowMaps>> create(gpu::Device& device, const scene::GpuScene& scene,
                                                      const LightPlan& plan,
                                                      const ShadowMapSettings& settings);

  // Fits and draws all maps for the instant. Blocks.
  Status draw(const scene::SceneInstant& instant, std::span<const PlacedLight> lights);
  // The sun's if it has a map, then the spots'.
  std::vector<ShadowRecord> records(const dvec3& origin) const;

  uint32_t count() const { return plan_.sun_shadows + plan_.spot_shadows; }
  const gpu::Image& sun_map() const { return sun_map_; }
  const gpu::Image& spot_maps() const { return spot_maps_; }

 private:
  struct Pipelines {
    gpu::RasterPipeline opaque, masked;
  };

  ShadowMaps(gpu::Device& device, const scene::GpuScene& scene, const LightPlan& plan,
             const ShadowMapSettings& settings)
      : device_(device), scene_(scene), plan_(plan), settings_(settings) {}
  Status create_pipelines(Pipelines& pipelines, bool depth_clamp);
  void record_map(gpu::Commands& commands, const scene::SceneInstant& instant, const ShadowFit& fit,
                  const Pipelines& pipelines, bool depth_clamp) const;

  gpu::Device& device_;
  const scene::GpuScene& scene_;
  LightPlan plan_;
  ShadowMapSettings settings_;
  gpu::Image sun_map_, spot_maps_;  // spots: side by side
  Pipelines sun_pipelines_, spot_pipelines_;
  std::vector<ShadowFit> fits_;
};

}  // namespace tessera::shading
