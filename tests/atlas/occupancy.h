// Checks that blocks lie inside the atlas and never overlap.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "atlas/placement.h"

namespace tessera::atlas {

class Occupancy {
 public:
  Occupancy(uint32_t width, uint32_t height)
      : width_(width), height_(height), taken_(size_t{width} * height) {}

  // False if the rectangle leaves the atlas or covers a texel that is taken.
  [[nodiscard]] bool take(uint32_t x, uint32_t y, uint32_t w, uint32_t h) {
    if (x + w > width_ || y + h > height_) return false;
    for (uint32_t row = y; row < y + h; ++row) {
      for (uint32_t column = x; column < x + w; ++column) {
        uint8_t& texel = taken_[size_t{row} * width_ + column];
        if (texel) return false;
        texel = 1;
      }
    }
    texels_ += uint64_t{w} * h;
    return true;
  }
  uint64_t texels() const { return texels_; }
  const std::vector<uint8_t>& taken() const { return taken_; }  // row by row

 private:
  uint32_t width_, height_;
  std::vector<uint8_t> taken_;
  uint64_t texels_ = 0;
};

}  // namespace tessera::atlas
