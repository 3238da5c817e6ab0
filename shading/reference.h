// The forward reference renderer: the truth in every comparison, and the source of the baselines' pictures.
// Same materials, lights and shadows as the gather passes; 4 shaded samples a pixel at the standard 4x MSAA
// positions, averaged in sRGB-encoded values (as the client's framebuffer resolves them). Texture gradients
// are analytic, for the footprint of a whole pixel.
#pragma once

#include <memory>
#include <vector>

#include "base/image.h"
#include "base/view.h"
#include "scene/gpu_scene.h"
#include "shading/lighting.h"

namespace tessera::shading {

struct ReferenceImage {
  Image8 color;  // sRGB
  // Of the centre sample: instanced triangle id + 1, 0 = background. Empty unless ids are asked for.
  std::vector<uint32_t> triangle_plus_one;
  // 1 where all samples hit geometry. Empty unless ids are asked for.
  std::vector<uint8_t> covered;
  // Of the centre sample: metres along -Z, infinity = background. Empty unless asked for.
  std::vector<float> depth;
};

struct ReferenceRequest {
  uint32_t samples = 4;  // 1 or 4
  bool ids = false;
  bool depth = false;
};

class ReferenceRenderer {
 public:
  static StatusOr<std::unique_ptr<ReferenceRenderer>> create(gpu::Device& device,
                                                             const scene::GpuScene& scene,
                                                             const Lighting& lighting);
  ~ReferenceRenderer();

  // Blocks. The background is kBackground. Device intervals, of each sample: "reference depth", "reference
  // color" (each visible sample is shaded once) and "reference copy"; "reference ids".
  StatusOr<ReferenceImage> render(const scene::SceneInstant& instant, const View& view,
                                  const ReferenceRequest& request);
  double gpu_ms() const;  // of the last render

 private:
  struct Impl;
  explicit ReferenceRenderer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

// sRGB colour of what no geometry covers, in truth and client.
constexpr uint8_t kBackground[3] = {135, 168, 205};

}  // namespace tessera::shading
