#include <gtest/gtest.h>

#include <cmath>

#include "tessellator.h"

namespace tessera::atlas::addressing::test {
namespace {

void expect_bijection(const std::vector<vec3>& points, const TessellationLevels& levels) {
  std::vector<bool> taken(points.size());
  for (const vec3& p : points) {
    const int id = oversampling_id(p, levels);
    ASSERT_TRUE(id >= 0 && id < static_cast<int>(points.size())) << points.size() << " samples: " << id;
    ASSERT_FALSE(taken[id]) << points.size() << " samples: " << id << " twice";
    taken[id] = true;
  }
}

TEST(Oversampling, IdsAreABijectionForEveryNumberOfSamples) {
  for (int count = 3; count <= kMaxTessellationVertices; ++count) {
    const TessellationLevels levels = tessellation_levels(count);
    expect_bijection(tessellated(levels), levels);
  }
}

TEST(Oversampling, IdsAreABijectionAsTheTessellatorGivesThePoints) {
  for (int count = 3; count <= kMaxTessellationVertices; ++count) {
    const TessellationLevels levels = tessellation_levels(count);
    expect_bijection(perturbed(tessellated(levels), levels.inner, static_cast<uint32_t>(count)), levels);
  }
}

// A block of samples told row by row, from the definition of its rows alone.
TEST(Staircase, ListsItsSamplesRowByRow) {
  for (int w = 1; w <= 40; ++w) {
    for (int h = w; h <= 120; ++h) {
      const ivec2 size(w, h);
      int id = 0;
      for (int y = 0; y <= h; ++y) {
        for (int x = 0; x < staircase_row(y, size); ++x, ++id) {
          ASSERT_EQ(staircase_position(id, size), ivec2(x, y)) << w << "x" << h << ": " << id;
        }
      }
      ASSERT_EQ(staircase_samples(size), id) << w << "x" << h;
    }
  }
}

// Between the first and the last sample of a row the position is counted on in whole numbers.
TEST(Staircase, RowsBeginAndEndWhereTheyShouldAtEverySize) {
  for (int w = 1; w <= 128; ++w) {
    for (int h = w; h <= 1024; ++h) {
      const ivec2 size(w, h);
      int id = 0;
      for (int y = 0; y <= h; ++y) {
        const int length = staircase_row(y, size);
        ASSERT_GE(length, 1) << w << "x" << h;
        const ivec2 first = staircase_position(id, size), last = staircase_position(id + length - 1, size);
        ASSERT_TRUE(first == ivec2(0, y) && last == ivec2(length - 1, y)) << w << "x" << h << " row " << y;
        id += length;
      }
      ASSERT_EQ(staircase_samples(size), id) << w << "x" << h;
    }
  }
}

// Row y and the one above are read for points from y - 1 to y, of which the widest is at y - 1.
TEST(Staircase, HoldsEveryBilinearFootprintOfItsTriangle) {
  for (int w = 1; w <= 128; ++w) {
    for (int h = w; h <= 1024; ++h) {
      const ivec2 size(w, h);
      ASSERT_EQ(staircase_row(0, size), w + 1);
      for (int y = 1; y <= h; ++y) {
        const int widest = (w * (h - y + 1) + h - 1) / h;  // w (1 - (y - 1) / h), rounded up
        ASSERT_TRUE(staircase_contains(ivec2(widest, y), size)) << w << "x" << h << " row " << y;
      }
    }
  }
}

TEST(Staircase, EndsAtItsBounds) {
  const ivec2 size(6, 17);
  EXPECT_TRUE(staircase_contains(ivec2(6, 0), size));
  EXPECT_FALSE(staircase_contains(ivec2(7, 0), size));
  EXPECT_FALSE(staircase_contains(ivec2(-1, 0), size));
  EXPECT_FALSE(staircase_contains(ivec2(0, -1), size));
  EXPECT_TRUE(staircase_contains(ivec2(0, 17), size));
  EXPECT_FALSE(staircase_contains(ivec2(0, 18), size));
}

}  // namespace
}  // namespace tessera::atlas::addressing::test
