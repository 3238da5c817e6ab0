#include "bench/borders.h"

#include <algorithm>

namespace tessera::bench {

std::vector<uint8_t> border_pixels(std::span<const uint32_t> labels, uint32_t width, uint32_t height) {
  std::vector<uint8_t> border(labels.size());
  for (uint32_t y = 0; y < height; ++y) {
    for (uint32_t x = 0; x < width; ++x) {
      const size_t i = size_t{y} * width + x;
      if (x + 1 < width && labels[i] != labels[i + 1]) border[i] = border[i + 1] = 1;
      if (y + 1 < height && labels[i] != labels[i + width]) border[i] = border[i + width] = 1;
    }
  }
  return border;
}

bool any_in_3x3(std::span<const uint8_t> mask, uint32_t width, uint32_t height, uint32_t x, uint32_t y) {
  const uint32_t x1 = std::min(x + 1, width - 1), y1 = std::min(y + 1, height - 1);
  for (uint32_t v = y > 0 ? y - 1 : 0; v <= y1; ++v) {
    for (uint32_t u = x > 0 ? x - 1 : 0; u <= x1; ++u) {
      if (mask[size_t{v} * width + u]) return true;
    }
  }
  return false;
}

}  // namespace tessera::bench
