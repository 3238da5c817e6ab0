#include "codec/padding.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <random>

namespace tessera::codec {
namespace {

using Block = std::array<uint8_t, 64>;

TEST(Padding, UsedValuesStayAndTheRestLiesBetweenThem) {
  std::mt19937_64 random(1);
  for (int round = 0; round < 500; ++round) {
    const uint64_t used = (random() & random() & random()) | (uint64_t{1} << (random() % 64));
    Block block;
    for (uint8_t& value : block) value = static_cast<uint8_t>(random());
    Block padded = block;
    pad_block(padded.data(), 8, used);
    int low = 255, high = 0;
    for (int i = 0; i < 64; ++i)
      if (used >> i & 1) low = std::min<int>(low, block[i]), high = std::max<int>(high, block[i]);
    for (int i = 0; i < 64; ++i) {
      if (used >> i & 1) {
        ASSERT_EQ(padded[i], block[i]);
      } else {
        ASSERT_GE(padded[i], low - 1);
        ASSERT_LE(padded[i], high + 1);
      }
    }
  }
}

TEST(Padding, OneLonelyValueFillsTheBlock) {
  for (int at = 0; at < 64; ++at) {
    Block block{};
    block[at] = 200;
    pad_block(block.data(), 8, uint64_t{1} << at);
    EXPECT_EQ(std::ranges::count(block, 200), 64) << at;
  }
}

// The upper left half of a block with a slope of its own: no step at the diagonal.
TEST(Padding, ContinuesWhatLiesBesideIt) {
  Block block{};
  uint64_t used = 0;
  for (int y = 0; y < 8; ++y)
    for (int x = 0; x < 8; ++x) {
      if (x + y > 7) continue;
      block[8 * y + x] = static_cast<uint8_t>(100 + 10 * y);
      used |= uint64_t{1} << (8 * y + x);
    }
  pad_block(block.data(), 8, used);
  for (int y = 1; y < 8; ++y) {
    const int x = 8 - y;  // just behind the diagonal
    EXPECT_LE(std::abs(block[8 * y + x] - block[8 * y + x - 1]), 20) << y;
  }
}

TEST(Padding, TouchesOnlyItsBlock) {
  std::array<uint8_t, 8 * 10> rows;
  rows.fill(7);
  pad_block(rows.data(), 10, 1);
  fill_block(rows.data(), 10, 9);
  EXPECT_EQ(block_mean(rows.data(), 10), 9);
  for (size_t i = 0; i < rows.size(); ++i) EXPECT_EQ(rows[i], i % 10 < 8 ? 9 : 7) << i;
}

}  // namespace
}  // namespace tessera::codec
