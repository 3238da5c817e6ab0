// Structural similarity (Wang et al. 2004) by separable windows.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/image.h"

namespace tessera::bench {

// One float a pixel, rows from top to bottom.
struct Plane {
  uint32_t width = 0, height = 0;
  std::vector<float> values;

  Plane() = default;
  Plane(uint32_t w, uint32_t h) : width(w), height(h), values(size_t{w} * h) {}
  float* row(uint32_t y) { return values.data() + size_t{y} * width; }
  const float* row(uint32_t y) const { return values.data() + size_t{y} * width; }
};

// BT.709 luma of the sRGB-encoded values, in [0, 1].
Plane luma(const Image8& image);
// Channel 0, 1 or 2 of the sRGB-encoded values, in [0, 1].
Plane channel(const Image8& image, uint32_t index);

// The weights of one axis (odd number, sum 1). At the borders the window is clipped and its weights are
// brought back to sum 1, so that every pixel has a value.
struct SsimWindow {
  std::vector<float> weights;
  float covariance_scale = 1;  // n/(n-1) for unbiased (co)variances of n equally weighted samples
};
SsimWindow gaussian_window(uint32_t size, double sigma);
SsimWindow uniform_window(uint32_t size);

// SSIM of each pixel with C1 = 1e-4, C2 = 9e-4. Both planes have the same, non-zero size; values in [0, 1].
Plane ssim_map(const Plane& a, const Plane& b, const SsimWindow& window);

// Mean over the pixels that are at least `inset` away from every border (over all if none is).
double mean(const Plane& plane, uint32_t inset = 0);

}  // namespace tessera::bench
