#include "codec/occupancy.h"

#include <algorithm>
#include <bit>

namespace tessera::codec {
namespace {

constexpr uint32_t kBlock = Occupancy::kBlock;

// Bits begin..end of the 8 of one side, of which some lie in the block that starts at `block`.
uint8_t side(uint32_t begin, uint32_t end, uint32_t block) {
  const uint32_t first = std::max(begin, block) - block, last = std::min(end, block + kBlock) - block;
  return static_cast<uint8_t>((1u << last) - (1u << first));
}

// Each set bit of `rows` becomes a byte with `columns`.
uint64_t product(uint8_t rows, uint8_t columns) {
  uint64_t bits = 0;
  for (uint32_t row = 0; row < kBlock; ++row)
    if (rows >> row & 1) bits |= uint64_t{columns} << (kBlock * row);
  return bits;
}

}  // namespace

void Occupancy::add_rectangle(uint32_t x, uint32_t y, uint32_t width, uint32_t height) {
  if (x >= width_ || y >= height_) return;
  const uint32_t right = x + std::min(width, width_ - x), bottom = y + std::min(height, height_ - y);
  for (uint32_t by = y / kBlock; by * kBlock < bottom; ++by) {
    const uint8_t rows = side(y, bottom, by * kBlock);
    for (uint32_t bx = x / kBlock; bx * kBlock < right; ++bx)
      blocks_[size_t{by} * columns_ + bx] |= product(rows, side(x, right, bx * kBlock));
  }
}

uint64_t Occupancy::texels() const {
  uint64_t sum = 0;
  for (const uint64_t block : blocks_) sum += static_cast<uint64_t>(std::popcount(block));
  return sum;
}

}  // namespace tessera::codec
