#include "codec/padding.h"

#include <algorithm>
#include <array>
#include <bit>

namespace tessera::codec {
namespace {

constexpr int kSide = 8, kFraction = 4;  // bits after the point, so that smoothing does not drift

using Values = std::array<int32_t, kSide * kSide>;

bool is_used(uint64_t used, int i) {
  return (used >> i & 1) != 0;
}

int32_t neighbours_mean(const Values& values, int i) {
  const int x = i % kSide, y = i / kSide;
  int32_t sum = 0, count = 0;
  const auto add = [&](bool inside, int neighbour) {
    if (!inside) return;
    sum += values[neighbour];
    ++count;
  };
  add(x > 0, i - 1);
  add(x < kSide - 1, i + 1);
  add(y > 0, i - kSide);
  add(y < kSide - 1, i + kSide);
  return sum / count;
}

// From one corner to the other and back: an unused value hears of the used ones on either side of it.
void smooth(Values& values, uint64_t used) {
  for (int i = 0; i < kSide * kSide; ++i)
    if (!is_used(used, i)) values[i] = neighbours_mean(values, i);
  for (int i = kSide * kSide - 1; i >= 0; --i)
    if (!is_used(used, i)) values[i] = neighbours_mean(values, i);
}

}  // namespace

void pad_block(uint8_t* block, size_t stride, uint64_t used) {
  Values values{};
  int32_t sum = 0;
  for (int i = 0; i < kSide * kSide; ++i) {
    if (!is_used(used, i)) continue;
    values[i] = block[i / kSide * stride + i % kSide] << kFraction;
    sum += values[i];
  }
  const int32_t mean = sum / std::popcount(used);
  for (int i = 0; i < kSide * kSide; ++i)
    if (!is_used(used, i)) values[i] = mean;
  smooth(values, used);
  for (int i = 0; i < kSide * kSide; ++i)
    if (!is_used(used, i))
      block[i / kSide * stride + i % kSide] =
          static_cast<uint8_t>((values[i] + (1 << (kFraction - 1))) >> kFraction);
}

uint8_t block_mean(const uint8_t* block, size_t stride) {
  uint32_t sum = kSide * kSide / 2;
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x) sum += block[y * stride + x];
  return static_cast<uint8_t>(sum / (kSide * kSide));
}

void fill_block(uint8_t* block, size_t stride, uint8_t value) {
  for (int y = 0; y < kSide; ++y) std::fill_n(block + y * stride, kSide, value);
}

}  // namespace tessera::codec
