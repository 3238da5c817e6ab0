#include "atlas/coherent/slabs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <random>

#include "occupancy.h"

namespace tessera::atlas::coherent {
namespace {

struct Rect {
  uvec2 at, size;
};

// No two rectangles overlap, and the counters tell what is there.
void check(const Slabs& slabs, const std::vector<Rect>& rects, uint32_t width, uint32_t height) {
  Occupancy occupancy(width, height);
  for (const Rect& r : rects) ASSERT_TRUE(occupancy.take(r.at.x, r.at.y, r.size.x, r.size.y));
  EXPECT_EQ(slabs.stats().used_texels, occupancy.texels());
  EXPECT_LE(slabs.stats().used_texels, slabs.stats().slab_texels);
  EXPECT_LE(slabs.stats().slab_texels, slabs.stats().capacity_texels);
  EXPECT_EQ(slabs.stats().capacity_texels, uint64_t{width} * height);
}

TEST(Slabs, RandomUseNeverOverlaps) {
  std::mt19937 random(1);
  const auto side = [&] { return 2 + 2 * static_cast<uint32_t>(random() % 16 * (random() % 8 + 1)); };
  for (const auto& [width, height] : {std::pair{512u, 512u}, {302u, 322u}, {64u, 8192u}, {8192u, 64u}}) {
    Slabs slabs(width, height);
    std::vector<Rect> rects;
    for (int frame = 0; frame < 60; ++frame) {
      for (size_t i = rects.size() / 4; i > 0; --i) {
        std::swap(rects[random() % rects.size()], rects.back());
        slabs.free(rects.back().at, rects.back().size.x, rects.back().size.y);
        rects.pop_back();
      }
      for (int i = 0; i < 200; ++i) {
        const uvec2 size(side(), side());
        if (const auto at = slabs.allocate(size.x, size.y)) rects.push_back({*at, size});
      }
      check(slabs, rects, width, height);
    }
    EXPECT_GT(static_cast<double>(slabs.stats().used_texels), 0.5 * width * height);
    for (const Rect& r : rects) slabs.free(r.at, r.size.x, r.size.y);
    EXPECT_EQ(slabs.stats().slab_texels, 0u) << "an emptied atlas serves every width again";
  }
}

TEST(Slabs, ExactlyFullThenOneTooMany) {
  Slabs slabs(256, 256);
  std::vector<Rect> rects;
  while (const auto at = slabs.allocate(16, 8)) rects.push_back({*at, {16, 8}});
  EXPECT_EQ(rects.size(), 512u);
  check(slabs, rects, 256, 256);
  EXPECT_EQ(slabs.free_share(), 0);
  EXPECT_FALSE(slabs.allocate(2, 2).has_value());
  slabs.free(rects[100].at, 16, 8);
  EXPECT_EQ(slabs.allocate(16, 8), rects[100].at);
}

TEST(Slabs, FreedNeighboursServeAHigherRectangle) {
  Slabs slabs(16, 256);
  std::vector<uvec2> at;
  for (int i = 0; i < 32; ++i) at.push_back(*slabs.allocate(16, 8));
  slabs.free(at[10], 16, 8);
  EXPECT_FALSE(slabs.allocate(16, 16).has_value());
  slabs.free(at[11], 16, 8);
  EXPECT_EQ(slabs.allocate(16, 16), at[10]);
}

TEST(Slabs, ANarrowRectangleTakesAWiderSlabBeforeItGoesWithout) {
  Slabs slabs(24, 256);
  slabs.allocate(24, 200);
  const auto at = slabs.allocate(16, 48);
  ASSERT_TRUE(at.has_value());
  EXPECT_EQ(*at, uvec2(0, 200));
  EXPECT_FALSE(slabs.allocate(4, 4).has_value()) << "not one that is twice as wide";
  slabs.free({0, 0}, 24, 200);
  slabs.free(*at, 16, 48);
  EXPECT_EQ(slabs.stats().used_texels, 0u);
}

// In a new slab of 256 rows, also where slabs of that width are lower.
uvec2 allocate_alone(Slabs& slabs, uint32_t width, uint32_t height) {
  if (height > 128) return *slabs.allocate(width, height);
  const uvec2 above = *slabs.allocate(width, 256 - height), at = *slabs.allocate(width, height);
  slabs.free(above, width, 256 - height);
  return at;
}

// A slab with `height` rows in use, and another of its width that has room for them. Returns where they are.
uvec2 allocate_movable(Slabs& slabs, uint32_t width, uint32_t height) {
  const uvec2 gap = *slabs.allocate(width, 152);
  slabs.allocate(width, 104);
  const uvec2 at = allocate_alone(slabs, width, height);
  slabs.free(gap, width, 152);
  return at;
}

// Else a few widths would fill a small atlas.
TEST(Slabs, ASlabIsASmallPartOfTheAtlasOrAsLowAsItCanBe) {
  for (const uvec2 sides : {uvec2(8192, 4096), {2048, 1024}, {256, 256}}) {
    Slabs slabs(sides.x, sides.y);
    for (uint32_t width = 2; width <= 256; width += 2) {
      for (uint32_t height = 2; height <= 256; height += 2) {
        const auto at = slabs.allocate(width, height);
        ASSERT_TRUE(at.has_value());
        const uint32_t lowest = std::max(std::bit_ceil(height), 32u);
        uint32_t rows = 256;  // as high as it may be
        while (rows > lowest && rows * width * 256 > sides.x * sides.y) rows /= 2;
        EXPECT_EQ(slabs.stats().slab_texels, width * rows) << width << "x" << height;
        slabs.free(*at, width, height);
      }
    }
  }
}

TEST(Slabs, ASmallAtlasHoldsARectangleOfEachWidth) {
  Slabs slabs(256, 256);
  std::vector<Rect> rects;
  for (uint32_t width = 80; width >= 2; width -= 2) {
    const auto at = slabs.allocate(width, 8);
    ASSERT_TRUE(at.has_value()) << width;
    rects.push_back({*at, {width, 8}});
  }
  check(slabs, rects, 256, 256);
}

TEST(Slabs, WhereTheBestHasNoRoomALowerSlabWillDo) {
  Slabs slabs(64, 8192);  // slabs of 8 have 256 rows, of 64 as few as they can
  std::vector<uvec2> at;
  while (const auto next = slabs.allocate(64, 128)) at.push_back(*next);
  ASSERT_EQ(at.size(), 64u);
  for (size_t i = 0; i < at.size(); i += 2) slabs.free(at[i], 64, 128);
  EXPECT_FALSE(slabs.allocate(8, 136).has_value()) << "gaps of 128 rows are left";
  EXPECT_TRUE(slabs.allocate(8, 8).has_value());
  EXPECT_EQ(slabs.stats().slab_texels, 32u * 64 * 128 + 8 * 128);
  slabs.free(at[1], 64, 128);
  EXPECT_TRUE(slabs.allocate(8, 136).has_value()) << "what found no room finds it once there is";
}

TEST(Slabs, WhatABudgetIsTooSmallForStopsNoOther) {
  Slabs slabs(512, 256);
  const uvec2 wide = allocate_movable(slabs, 192, 60), narrow = allocate_movable(slabs, 16, 100);
  EXPECT_FALSE(slabs.close_emptiest(1024, 0.75f)) << "each holds more";
  EXPECT_TRUE(slabs.close_emptiest(4096, 0.75f));
  EXPECT_TRUE(slabs.closed(narrow)) << "though it is fuller";
  EXPECT_FALSE(slabs.closed(wide));
}

// It would draw a new slab.
TEST(Slabs, WhatHasNoRoomInOthersOfItsWidthStays) {
  Slabs slabs(512, 256);
  const uvec2 alone = *slabs.allocate(64, 10), first = *slabs.allocate(32, 150),
              second = *slabs.allocate(32, 120);
  EXPECT_FALSE(slabs.close_emptiest(uint64_t{1} << 30, 0.75f));
  slabs.free(second, 32, 120);
  const uvec2 lower = *slabs.allocate(32, 106);
  slabs.allocate(32, 90);
  slabs.free(lower, 32, 106);
  EXPECT_TRUE(slabs.close_emptiest(uint64_t{1} << 30, 0.75f));
  EXPECT_FALSE(slabs.closed(alone) || slabs.closed(first));
}

TEST(Slabs, RoomIsMadeOnlyWhereItIsHighEnough) {
  Slabs slabs(64, 320);  // below the first 256 rows are 64
  const uvec2 high = *slabs.allocate(64, 200), low = *slabs.allocate(64, 64);
  ASSERT_EQ(low.y, 256u);
  slabs.free(low, 64, 64);
  EXPECT_TRUE(slabs.close_for(64, 100, 1 << 20)) << "the free room is too low";
  EXPECT_TRUE(slabs.closed(high));
}

TEST(Slabs, WholeSquaresComeFromTheLeftAndTheTopAndTheRestFromTheOtherEnds) {
  Slabs slabs(4096, 256);
  EXPECT_EQ(slabs.allocate(8, 16), uvec2(0, 0));
  EXPECT_EQ(slabs.allocate(8, 4), uvec2(0, 252));
  EXPECT_EQ(slabs.allocate(8, 2), uvec2(0, 250));
  EXPECT_EQ(slabs.allocate(8, 12), uvec2(0, 236)) << "at a multiple of four";
  EXPECT_EQ(slabs.allocate(8, 8), uvec2(0, 16));
  EXPECT_EQ(slabs.allocate(12, 8), uvec2(4084, 0));
  EXPECT_EQ(slabs.allocate(2, 8), uvec2(4082, 0));
  EXPECT_EQ(slabs.allocate(4, 8), uvec2(4076, 0)) << "at a multiple of four";
  EXPECT_EQ(slabs.allocate(16, 8), uvec2(8, 0));
}

// Whatever else comes and goes.
TEST(Slabs, WholeSquaresStandOnSquares) {
  std::mt19937 random(11);
  const auto side = [&](uint32_t most) {
    return random() % 2 ? 8 * (1 + random() % (most / 8)) : 2 * (1 + random() % 8);
  };
  Slabs slabs(512, 512);
  std::vector<std::pair<uvec2, uvec2>> held;
  int of = 0, on_grid = 0;
  for (int i = 0; i < 5000; ++i) {
    const uvec2 sides(side(48), side(120));
    if (const auto at = slabs.allocate(sides.x, sides.y)) {
      held.emplace_back(*at, sides);
      const uint32_t step = sides.y % 8 == 0 ? 8 : sides.y % 4 == 0 ? 4 : 2;
      EXPECT_EQ(at->y % step, 0u) << sides.y;
      of += sides.x % 8 == 0;
      on_grid += sides.x % 8 == 0 && at->x % 8 == 0;
    }
    if (held.size() < 100) continue;
    std::swap(held[random() % held.size()], held.back());
    const auto [at, free_sides] = held.back();
    held.pop_back();
    slabs.free(at, free_sides.x, free_sides.y);
  }
  EXPECT_GT(of, 1000);
  EXPECT_GE(on_grid, 9 * of / 10) << "but for those in slabs of other widths";
}

// A square's place may begin within a slab.
TEST(Slabs, RoomIsMadeWhereSlabsStandOffSquares) {
  for (const size_t emptier : {0u, 1u, 2u, 3u, 4u}) {
    Slabs slabs(64, 256);
    std::vector<uvec2> at;
    for (int i = 0; i < 5; ++i) at.push_back(*slabs.allocate(12, 256));
    slabs.free(at[emptier], 12, 256);
    at[emptier] = *slabs.allocate(12, 16);
    ASSERT_FALSE(slabs.allocate(8, 256).has_value());
    ASSERT_TRUE(slabs.close_for(8, 256, 12 * 16)) << at[emptier].x;
    for (size_t i = 0; i < at.size(); ++i) EXPECT_EQ(slabs.closed(at[i]), i == emptier) << emptier;
    slabs.free(at[emptier], 12, 16);
    EXPECT_TRUE(slabs.allocate(8, 256).has_value()) << emptier;
  }
}

TEST(Slabs, RoomIsMadeWhereItIsCheapest) {
  Slabs slabs(256, 256);
  // Eight slabs; the fourth and the fifth hold least, but for the last, which stands alone.
  std::vector<uvec2> at, rest;
  const uint32_t heights[] = {200, 160, 180, 60, 80, 220, 240, 20};
  for (const uint32_t height : heights) {
    at.push_back(allocate_alone(slabs, 32, height));
    rest.push_back(*slabs.allocate(32, 256 - height));
  }
  for (size_t i = 0; i < rest.size(); ++i) slabs.free(rest[i], 32, 256 - heights[i]);
  EXPECT_FALSE(slabs.close_for(64, 256, 32 * (60 + 80) - 1)) << "more than may move";
  ASSERT_TRUE(slabs.close_for(64, 256, 32 * (60 + 80)));
  for (size_t i = 0; i < at.size(); ++i) EXPECT_EQ(slabs.closed(at[i]), i == 3 || i == 4) << i;
  slabs.free(at[3], 32, 60);
  slabs.free(at[4], 32, 80);
  EXPECT_FALSE(slabs.close_for(64, 256, 1 << 20)) << "there is room";
  EXPECT_EQ(slabs.allocate(64, 256), uvec2(96, 0));
}

TEST(Slabs, ClosedSlabsAreTheEmptiestAndTakeNothing) {
  Slabs slabs(16 + 2 * 32 + 2 * 8, 256);
  const uvec2 full = *slabs.allocate(16, 256), half = allocate_movable(slabs, 32, 100),
              sparse = allocate_movable(slabs, 8, 2);
  slabs.close_emptiest(8 * 2, 0.75f);
  EXPECT_TRUE(slabs.closed(sparse));
  EXPECT_FALSE(slabs.closed(half) || slabs.closed(full));
  slabs.close_emptiest(uint64_t{1} << 30, 0.75f);
  EXPECT_TRUE(slabs.closed(half));
  EXPECT_FALSE(slabs.closed(full)) << "fuller than asked for";
  ASSERT_TRUE(slabs.allocate(32, 152).has_value()) << "in the other slab";
  EXPECT_FALSE(slabs.allocate(32, 8).has_value());
  slabs.free(half, 32, 100);
  EXPECT_FALSE(slabs.allocate(32, 8, false).has_value()) << "needs a new slab";
  EXPECT_TRUE(slabs.allocate(32, 8).has_value()) << "an emptied slab returns to its shelf";
  slabs.reopen();
  EXPECT_FALSE(slabs.closed(sparse));
}

}  // namespace
}  // namespace tessera::atlas::coherent
