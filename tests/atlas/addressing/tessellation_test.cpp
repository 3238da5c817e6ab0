#include <gtest/gtest.h>

#include "tessellator.h"

namespace tessera::atlas::addressing::test {
namespace {

TEST(Tessellation, CountsTheVerticesOfEveryLevel) {
  for (int level = 1; level <= kMaxTessellationLevel; ++level)
    EXPECT_EQ(tessellation_vertices(level), static_cast<int>(tessellated(uniform_levels(level)).size()));
  EXPECT_EQ(tessellation_vertices(1), 3);
  EXPECT_EQ(tessellation_vertices(0), 1);
  EXPECT_EQ(tessellation_vertices(-1), 0);
  EXPECT_EQ(tessellation_vertices(-2), 0);
  EXPECT_EQ(tessellation_vertices(kMaxTessellationLevel), kMaxTessellationVertices);
}

TEST(Tessellation, LevelsMakeExactlyTheVerticesAskedFor) {
  for (int count = 3; count <= kMaxTessellationVertices; ++count) {
    const TessellationLevels levels = tessellation_levels(count);
    ASSERT_EQ(static_cast<int>(tessellated(levels).size()), count);
    for (int side = 0; side < 3; ++side) {
      ASSERT_GE(levels.outer[side], 1) << count;
      ASSERT_LE(levels.outer[side], levels.inner) << count;
    }
    ASSERT_LE(levels.inner, kMaxTessellationLevel);
    ASSERT_TRUE(levels.inner > 1 || count == 3) << "the tessellator would take an inside of 1 for 2";
    ASSERT_LE(levels.outer.x - levels.outer.z, 1) << count;
  }
}

TEST(Tessellation, TheInsideIsAsSmallAsItCanBe) {
  int last = 1;
  for (int count = 3; count <= kMaxTessellationVertices; ++count) {
    const int inner = tessellation_levels(count).inner;
    ASSERT_GE(inner, last) << count;
    ASSERT_LT(tessellation_vertices(inner - 1), count);
    last = inner;
  }
}

TEST(Tessellation, LevelsAreThoseOfAUniformTriangleWhereOneHasTheCount) {
  for (int level = 1; level <= kMaxTessellationLevel; ++level) {
    const TessellationLevels levels = tessellation_levels(tessellation_vertices(level));
    EXPECT_EQ(levels.outer, ivec3(level));
    EXPECT_EQ(levels.inner, level);
  }
}

}  // namespace
}  // namespace tessera::atlas::addressing::test
