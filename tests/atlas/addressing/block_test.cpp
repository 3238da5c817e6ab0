#include <gtest/gtest.h>

#include <cmath>

#include "atlas/addressing/addressing.h"
#include "scene/scene.h"

namespace tessera::atlas::addressing {
namespace {

constexpr int kSides[] = {2, 3, 4, 5, 7, 8, 13, 31, 64, 100, 255, 256};

template <class F>
void for_sizes(F&& visit) {
  for (const int w : kSides)
    for (const int h : kSides) visit(ivec2(w, h));
}

TEST(Block, CornersAreThoseOfThePatch) {
  for (int count = 1; count <= 3; ++count)
    for (int triangle = 0; triangle < count; ++triangle)
      for (int corner = 0; corner < 3; ++corner)
        EXPECT_EQ(block_corner(count, triangle, corner), scene::patch_corner(count, triangle, corner));
}

vec2 corner_texel(int count, int triangle, int corner, vec2 extent) {
  return block_corner_texel(block_corner(count, triangle, corner), extent);
}

TEST(Block, CornersLieAtWholeTexelsOfTheBlock) {
  for_sizes([](ivec2 size) {
    const vec2 extent(size - 1);
    for (int count = 1; count <= 3; ++count) {
      for (int triangle = 0; triangle < count; ++triangle) {
        for (int corner = 0; corner < 3; ++corner) {
          const vec2 at = corner_texel(count, triangle, corner, extent);
          EXPECT_EQ(at, floor(at));
          EXPECT_TRUE(at.x >= 0 && at.y >= 0 && at.x <= extent.x && at.y <= extent.y);
          EXPECT_LE(glm::length(at - block_corner(count, triangle, corner) * extent), 0.5f);
        }
      }
    }
  });
}

// The texel's own place, from the point of the patch that it shows.
vec2 place_of(const BlockPoint& p, int count, vec2 extent) {
  const vec2 a = corner_texel(count, p.triangle, 0, extent);
  return a + p.weights.x * (corner_texel(count, p.triangle, 1, extent) - a) +
         p.weights.y * (corner_texel(count, p.triangle, 2, extent) - a);
}

TEST(Block, TexelsShowThePointThatIsDrawnThere) {
  for_sizes([](ivec2 size) {
    const vec2 extent(size - 1);
    for (int count = 1; count <= 3; ++count) {
      if (count == 3 && size.x == 2) continue;  // two texels cannot hold three triangles
      for (int y = 0; y < size.y; ++y) {
        for (int x = 0; x < size.x; ++x) {
          const vec2 at(x, y);
          const BlockPoint p = block_point(count, at, extent);
          ASSERT_TRUE(p.triangle >= 0 && p.triangle < count);
          EXPECT_LE(p.weights.x + p.weights.y, 1 + 1e-5f);
          vec2 shown = at;
          // The unused half repeats the long edge.
          const float excess = at.x / extent.x + at.y / extent.y - 1;
          if (count == 1 && excess > 0) shown -= 0.5f * excess * extent;
          EXPECT_LT(glm::length(place_of(p, count, extent) - shown), 1e-3f)
              << count << " in " << size.x << "x" << size.y << " at " << x << ", " << y;
        }
      }
    }
  });
}

TEST(Block, DerivativesAreTheDifferencesOfNeighbours) {
  const vec2 extent(12, 6);
  for (int count = 1; count <= 3; ++count) {
    for (int triangle = 0; triangle < count; ++triangle) {
      vec2 middle(0);
      for (int corner = 0; corner < 3; ++corner)
        middle += corner_texel(count, triangle, corner, extent) / 3.0f;
      const BlockPoint p = block_point(count, middle, extent);
      ASSERT_EQ(p.triangle, triangle);
      const float d = 0.01f;
      const vec2 right = block_point(count, middle + vec2(d, 0), extent).weights - p.weights;
      const vec2 down = block_point(count, middle + vec2(0, d), extent).weights - p.weights;
      EXPECT_LT(glm::length(right / d - p.ddx), 1e-4f);
      EXPECT_LT(glm::length(down / d - p.ddy), 1e-4f);
    }
  }
}

TEST(Block, TheSmallestBlocksAreFiniteAtEveryTexel) {
  for (int count = 1; count <= 3; ++count) {
    for (const ivec2& size : {ivec2(1, 1), ivec2(1, 2), ivec2(2, 1), ivec2(2, 2)}) {
      for (int i = 0; i < size.x * size.y; ++i) {
        const BlockPosition at = block_position(ivec2(i % size.x, i / size.x), size, false);
        const BlockPoint p = block_point(count, at.at, at.extent);
        for (const vec2& v : {p.weights, p.ddx, p.ddy}) EXPECT_TRUE(std::isfinite(v.x) && std::isfinite(v.y));
      }
    }
  }
}

TEST(Block, ASideOfOneTexelStandsForTheMiddle) {
  const BlockPosition p = block_position(ivec2(0, 3), ivec2(1, 8), false);
  EXPECT_EQ(p.at, vec2(0.5f, 3));
  EXPECT_EQ(p.extent, vec2(1, 7));
}

TEST(Block, TransposedSwapsTheAxes) {
  const BlockPosition p = block_position(ivec2(2, 5), ivec2(4, 9), true);
  EXPECT_EQ(p.at, vec2(5, 2));
  EXPECT_EQ(p.extent, vec2(8, 3));
}

TEST(Block, MaskedBlocksKeepColourAndCoverageApart) {
  for_sizes([](ivec2 size) {
    const ivec2 color = block_color_size(size, true), offset = block_coverage_offset(size);
    ASSERT_TRUE(color.x >= 1 && color.y >= 1);
    for (int y = 0; y < color.y; ++y) {
      for (int x = 0; x < color.x; ++x) {
        const ivec2 texel(x, y);
        const BlockTexel in_color = block_half(texel, size, true);
        const BlockTexel in_coverage = block_half(texel + offset, size, true);
        ASSERT_TRUE(!in_color.coverage && in_coverage.coverage);
        ASSERT_TRUE(in_color.texel == texel && in_coverage.texel == texel);
        ASSERT_TRUE(x + offset.x < size.x && y + offset.y < size.y);
      }
    }
    EXPECT_EQ(color.x * color.y, size.x > size.y ? size.x / 2 * size.y : size.x * (size.y / 2));
  });
}

TEST(Block, OpaqueBlocksAreAllColour) {
  const ivec2 size(16, 4);
  EXPECT_EQ(block_color_size(size, false), size);
  const BlockTexel last = block_half(size - 1, size, false);
  EXPECT_FALSE(last.coverage);
  EXPECT_EQ(last.texel, size - 1);
}

}  // namespace
}  // namespace tessera::atlas::addressing
