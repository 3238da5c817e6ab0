// How well the silhouettes of alpha-masked surfaces (leaves, chains, fences) come out: where they are, what
// they cost, and the part of a picture that shows most of them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/image.h"
#include "bench/ssim.h"
#include "scene/scene.h"

namespace tessera::bench {

// The instanced triangles of masked materials.
class MaskedTriangles {
 public:
  explicit MaskedTriangles(const scene::Scene& scene);
  bool empty() const { return ranges_.empty(); }
  bool contains(uint32_t instanced_triangle) const;

 private:
  struct Range {
    uint32_t first, end;
  };
  std::vector<Range> ranges_;  // by `first`
};

// 1 where a pixel of a masked material touches one of another material or of the background, and where such
// a pixel touches it. `triangle_plus_one` as in shading::ReferenceImage.
std::vector<uint8_t> masked_edges(std::span<const uint32_t> triangle_plus_one, uint32_t width,
                                  uint32_t height, const MaskedTriangles& masked);

// The sum of a map over the pixels within 2 px of the edges, and their number: sums of frames add up.
struct EdgeSum {
  double sum = 0;
  uint64_t pixels = 0;

  double mean() const { return pixels ? sum / static_cast<double>(pixels) : 1; }
  void add(const EdgeSum& other) {
    sum += other.sum;
    pixels += other.pixels;
  }
};
EdgeSum sum_near(std::span<const uint8_t> edges, const Plane& ssim);

// A part of a picture.
struct Window {
  uint32_t x = 0, y = 0, width = 0, height = 0;
  uint64_t edges = 0;  // edge pixels inside
};
// The square of at most `side` pixels with the most edge pixels; of equals the first in reading order.
Window busiest_window(std::span<const uint8_t> edges, uint32_t width, uint32_t height, uint32_t side);

// The window, each of its pixels as a square of `scale` pixels.
Image8 enlarged(const Image8& image, const Window& window, uint32_t scale);
Plane enlarged(const Plane& plane, const Window& window, uint32_t scale);

}  // namespace tessera::bench
