#include "bench/masked_edges.h"

#include <algorithm>
#include <cassert>

#include "bench/borders.h"

namespace tessera::bench {

MaskedTriangles::MaskedTriangles(const scene::Scene& scene) {
  for (const scene::Instance& instance : scene.instances) {
    if (scene.materials[instance.material].alpha_mode != scene::AlphaMode::mask) continue;
    const uint32_t end = instance.first_triangle + scene.geometries[instance.geometry].triangle_count();
    ranges_.push_back({instance.first_triangle, end});
  }
  std::sort(ranges_.begin(), ranges_.end(), [](const Range& a, const Range& b) { return a.first < b.first; });
}

bool MaskedTriangles::contains(uint32_t instanced_triangle) const {
  const auto after = std::upper_bound(ranges_.begin(), ranges_.end(), instanced_triangle,
                                      [](uint32_t triangle, const Range& r) { return triangle < r.first; });
  return after != ranges_.begin() && instanced_triangle < (after - 1)->end;
}

std::vector<uint8_t> masked_edges(std::span<const uint32_t> triangle_plus_one, uint32_t width,
                                  uint32_t height, const MaskedTriangles& masked) {
  std::vector<uint32_t> is_masked(triangle_plus_one.size());
  for (size_t i = 0; i < is_masked.size(); ++i) {
    const uint32_t id = triangle_plus_one[i];
    is_masked[i] = id != 0 && masked.contains(id - 1);
  }
  return border_pixels(is_masked, width, height);
}

EdgeSum sum_near(std::span<const uint8_t> edges, const Plane& ssim) {
  assert(edges.size() == ssim.values.size());
  EdgeSum result;
  for (uint32_t y = 0; y < ssim.height; ++y) {
    for (uint32_t x = 0; x < ssim.width; ++x) {
      if (!any_in_3x3(edges, ssim.width, ssim.height, x, y)) continue;
      result.sum += ssim.row(y)[x];
      ++result.pixels;
    }
  }
  return result;
}

Window busiest_window(std::span<const uint8_t> edges, uint32_t width, uint32_t height, uint32_t side) {
  // sums[y][x] = edges above and left of (x, y).
  const size_t stride = size_t{width} + 1;
  std::vector<uint32_t> sums(stride * (size_t{height} + 1));
  for (uint32_t y = 0; y < height; ++y) {
    uint32_t row = 0;
    for (uint32_t x = 0; x < width; ++x) {
      row += edges[size_t{y} * width + x];
      sums[(y + 1) * stride + x + 1] = sums[y * stride + x + 1] + row;
    }
  }
  Window best{0, 0, std::min(side, width), std::min(side, height)};
  for (uint32_t y = 0; y + best.height <= height; ++y) {
    const uint32_t *top = &sums[y * stride], *bottom = &sums[(y + best.height) * stride];
    for (uint32_t x = 0; x + best.width <= width; ++x) {
      const uint32_t inside = bottom[x + best.width] - bottom[x] - top[x + best.width] + top[x];
      if (inside <= best.edges) continue;
      best.x = x;
      best.y = y;
      best.edges = inside;
    }
  }
  return best;
}

Image8 enlarged(const Image8& image, const Window& window, uint32_t scale) {
  Image8 out(window.width * scale, window.height * scale);
  for (uint32_t y = 0; y < out.height; ++y) {
    for (uint32_t x = 0; x < out.width; ++x) {
      std::copy_n(image.at(window.x + x / scale, window.y + y / scale), 4, out.at(x, y));
    }
  }
  return out;
}

Plane enlarged(const Plane& plane, const Window& window, uint32_t scale) {
  Plane out(window.width * scale, window.height * scale);
  for (uint32_t y = 0; y < out.height; ++y) {
    const float* from = plane.row(window.y + y / scale) + window.x;
    for (uint32_t x = 0; x < out.width; ++x) out.row(y)[x] = from[x / scale];
  }
  return out;
}

}  // namespace tessera::bench
