// Baseline: depth mesh warping (MW in thesis 7.2.2). A dense grid with one quad a pixel, displaced by the
// source's depth and drawn from the new view. Quads across a depth discontinuity stretch, as in the
// publication.
//
// In the baseline's favour: depth is exact and costs no bits, the source is supersampled, the result has 4x
// MSAA, and what lies outside the source view shows the background colour instead of a hole.
#pragma once

#include <memory>
#include <span>

#include "base/image.h"
#include "base/status.h"
#include "base/view.h"
#include "gpu/device.h"

namespace tessera::bench {

class MeshWarp {
 public:
  // Source sides from 2 to 8192 pixels. `background`: sRGB.
  static StatusOr<std::unique_ptr<MeshWarp>> create(gpu::Device& device, uint32_t source_width,
                                                    uint32_t source_height, uint32_t target_width,
                                                    uint32_t target_height, const uint8_t background[3]);
  ~MeshWarp();

  // `depth`: metres along the source camera's -Z, infinity = background (shading::ReferenceImage::depth).
  // Sizes as given to create().
  Status set_source(const View& view, const Image8& color, std::span<const float> depth);
  // The last source as seen from `target`. Blocks.
  StatusOr<Image8> draw(const View& target);
  double gpu_ms() const;  // of the last draw()

 private:
  struct Impl;
  explicit MeshWarp(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

// The view that a server renders as source for `client`: the field of view 20 % larger (thesis 7.2), with as
// many more pixels as keep the resolution at the centre; even sides.
View warp_source_view(const View& client);

}  // namespace tessera::bench
