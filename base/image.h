// Pixels on the CPU.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace tessera {

// 8-bit RGBA, rows from top to bottom, no padding. Colour is sRGB-encoded unless a holder says otherwise.
struct Image8 {
  uint32_t width = 0, height = 0;
  std::vector<uint8_t> rgba;  // 4 * width * height bytes

  Image8() = default;
  Image8(uint32_t w, uint32_t h) : width(w), height(h), rgba(size_t{4} * w * h) {}
  uint8_t* at(uint32_t x, uint32_t y) { return rgba.data() + 4 * (size_t{y} * width + x); }
  const uint8_t* at(uint32_t x, uint32_t y) const { return rgba.data() + 4 * (size_t{y} * width + x); }
};

}  // namespace tessera
