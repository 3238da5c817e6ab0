// Pictures made for the tests.
#pragma once

#include <algorithm>
#include <cstdint>

#include "base/image.h"

namespace tessera::bench {

inline Image8 make_image(uint32_t width, uint32_t height, auto&& value) {
  Image8 image(width, height);
  for (uint32_t y = 0; y < height; ++y) {
    for (uint32_t x = 0; x < width; ++x) {
      for (uint32_t c = 0; c < 3; ++c) image.at(x, y)[c] = static_cast<uint8_t>(value(x, y, c));
      image.at(x, y)[3] = 255;
    }
  }
  return image;
}

inline uint32_t texture_value(uint32_t x, uint32_t y, uint32_t c) {
  return (x * 17 + y * 29 + c * 53 + (x * y * 7) % 31) % 256;
}

inline Image8 textured(uint32_t width, uint32_t height) {
  return make_image(width, height, texture_value);
}

// The same with a small disturbance in every channel.
inline Image8 textured_disturbed(uint32_t width, uint32_t height) {
  return make_image(width, height, [](uint32_t x, uint32_t y, uint32_t c) {
    const int v =
        static_cast<int>(texture_value(x, y, c)) + static_cast<int>((x * 5 + y * 3 + c * 11) % 23) - 11;
    return std::clamp(v, 0, 255);
  });
}

inline Image8 uniform_image(uint32_t width, uint32_t height, uint8_t value) {
  return make_image(width, height, [value](uint32_t, uint32_t, uint32_t) { return value; });
}

}  // namespace tessera::bench
