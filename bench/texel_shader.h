// Shades tiles of unique textures on the device (bench/texel_shading.h), with the materials and lights of
// every other pass: the compute pass of texel shading.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "base/view.h"
#include "bench/texel_shading.h"
#include "scene/gpu_scene.h"
#include "shading/lighting.h"

namespace tessera::bench {

struct ShadedTexels {
  // sRGB, 0xAABBGGRR; 64 a tile, row by row, in the order of the tiles; 0 where a texel shows nothing.
  std::vector<uint32_t> colors;
  uint64_t samples = 0;  // texels that were shaded
  double gpu_ms = 0;     // of shading them
};

class TexelShader {
 public:
  static constexpr uint32_t kMaxTiles = 256 * 1024;

  // All four outlive it. InvalidArgument if its textures are larger than 65535
  // texels along a side.
  static StatusOr<std::unique_ptr<TexelShader>> create(gpu::Device& device, const scene::GpuScene& scene,
                                                       const shading::Lighting& lighting,
                                                       const UniqueTexture& texture);
  ~TexelShader();

  // As seen by `viewer`. At most kMaxTiles; one may come twice. Blocks. Device interval "texel shading".
  StatusOr<ShadedTexels> shade(const scene::SceneInstant& instant, const View& viewer,
                               std::span<const TexelTile> tiles);

 private:
  struct Impl;
  explicit TexelShader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::bench
