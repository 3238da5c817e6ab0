// Which texels of an atlas hold samples. What lies between them need not be coded.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace tessera::codec {

// One bit a texel, by 8x8 blocks, the squares that JPEG transforms. Texels beyond the right and the lower
// border are never used.
class Occupancy {
 public:
  static constexpr uint32_t kBlock = 8;
  static constexpr uint64_t kFull = ~uint64_t{0};

  Occupancy() = default;
  // Nothing is used.
  Occupancy(uint32_t width, uint32_t height)
      : width_(width), height_(height), columns_((width + kBlock - 1) / kBlock) {
    clear();
  }

  uint32_t width() const { return width_; }
  uint32_t height() const { return height_; }
  void clear() { blocks_.assign(size_t{columns_} * ((height_ + kBlock - 1) / kBlock), 0); }

  // Clipped at the borders.
  void add_rectangle(uint32_t x, uint32_t y, uint32_t width, uint32_t height);
  // Texel (x, y) of the block at column `bx` and row `by` is bit 8 * y + x; 0 beyond the borders.
  uint64_t block(uint32_t bx, uint32_t by) const {
    const size_t at = size_t{by} * columns_ + bx;
    return bx < columns_ && at < blocks_.size() ? blocks_[at] : 0;
  }
  bool uses(uint32_t x, uint32_t y) const {
    return (block(x / kBlock, y / kBlock) >> (kBlock * (y % kBlock) + x % kBlock) & 1) != 0;
  }
  uint64_t texels() const;  // used

 private:
  uint32_t width_ = 0, height_ = 0, columns_ = 0;
  std::vector<uint64_t> blocks_;
};

}  // namespace tessera::codec
