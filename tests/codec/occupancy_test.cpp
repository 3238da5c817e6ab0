#include "codec/occupancy.h"

#include <gtest/gtest.h>

#include <random>

namespace tessera::codec {
namespace {

TEST(Occupancy, RectanglesMarkTheirTexelsAndNoOthers) {
  // Not multiples of 8, so that the last blocks reach beyond the picture.
  constexpr uint32_t kWidth = 37, kHeight = 29;
  std::mt19937 random(1);
  for (int round = 0; round < 200; ++round) {
    Occupancy used(kWidth, kHeight);
    std::vector<bool> expected(size_t{kWidth} * kHeight);
    for (int i = 0; i < 3; ++i) {
      const uint32_t x = random() % 45, y = random() % 45, width = random() % 30, height = random() % 30;
      used.add_rectangle(x, y, width, height);
      for (uint32_t row = y; row < std::min(y + height, kHeight); ++row)
        for (uint32_t column = x; column < std::min(x + width, kWidth); ++column)
          expected[size_t{row} * kWidth + column] = true;
    }
    for (uint32_t y = 0; y < 40; ++y)
      for (uint32_t x = 0; x < 40; ++x)
        ASSERT_EQ(used.uses(x, y), x < kWidth && y < kHeight && expected[size_t{y} * kWidth + x])
            << x << "," << y << " in round " << round;
    EXPECT_EQ(used.texels(), static_cast<uint64_t>(std::count(expected.begin(), expected.end(), true)));
  }
}

TEST(Occupancy, HugeRectanglesAreClipped) {
  Occupancy used(16, 8);
  used.add_rectangle(8, 0, UINT32_MAX, UINT32_MAX);
  EXPECT_EQ(used.block(0, 0), 0u);
  EXPECT_EQ(used.block(1, 0), Occupancy::kFull);
  EXPECT_EQ(used.block(0, 1), 0u);
  EXPECT_EQ(used.block(2, 0), 0u) << "not the next row's";
  used.clear();
  EXPECT_EQ(used.texels(), 0u);
}

}  // namespace
}  // namespace tessera::codec
