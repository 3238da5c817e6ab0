// Splits, steps of the L, and halves: what layout `tessellated` adds to L-packing and Oversampling.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "atlas/addressing/addressing.h"

namespace tessera::atlas::addressing {
namespace {

TEST(LPacking, SamplesAreTheTexelsOfTheL) {
  for (int level = 1; level <= kMaxTessellationLevel; ++level) {
    std::set<std::pair<int, int>> texels;
    for (int i = 0; i < l_samples(level); ++i) {
      const ivec2 at = l_sample(i, level);
      EXPECT_TRUE(l_contains(at, level)) << level << " " << i;
      EXPECT_TRUE(texels.insert({at.x, at.y}).second) << level << " " << i;
    }
    int all = 0;
    for (int y = 0; y <= level; ++y)
      for (int x = 0; x <= level; ++x) all += l_contains({x, y}, level);
    EXPECT_EQ(all, l_samples(level));
  }
}

// Between neighbours of one section the steps are the difference.
TEST(LPacking, StepsAreDifferencesWithinASection) {
  const auto same = [](const LSection& a, const LSection& b) {
    return a.tip == b.tip && a.column_is_x == b.column_is_x;
  };
  int compared = 0;
  for (int level = 1; level <= kMaxTessellationLevel; ++level) {
    for (int i = 0; i < l_samples(level); ++i) {
      const ivec2 at = l_sample(i, level);
      const LSteps steps = l_steps(at, level);
      for (const ivec2 step : {ivec2(1, 0), ivec2(0, 1)}) {
        const ivec2 next = at + step;
        if (!l_contains(next, level) || !same(l_section(at, level), l_section(next, level))) continue;
        const vec3 difference = l_barycentric(next, level) - l_barycentric(at, level);
        const vec3 expected = step.x == 1 ? steps.ddx : steps.ddy;
        for (int c = 0; c < 3; ++c) ASSERT_NEAR(difference[c], expected[c], 1e-6f) << level << " " << i;
        ++compared;
      }
    }
  }
  EXPECT_GT(compared, 100'000);
}

TEST(Split, PlaceIsTheInverseOfPoint) {
  for (int n = 1; n <= kMaxSplits; ++n) {
    std::set<int> seen;
    for (int i = 0; i <= 3 * n; ++i)
      for (int j = 0; i + j <= 3 * n; ++j) {
        const vec3 lambda(float(3 * n - i - j) / float(3 * n), float(i) / float(3 * n),
                          float(j) / float(3 * n));
        const SplitPoint point = split_point(lambda, n);
        ASSERT_TRUE(point.index >= 0 && point.index < n * n);
        seen.insert(point.index);
        const SplitPlace place = split_place(point.index, n);
        for (int c = 0; c < 3; ++c) ASSERT_TRUE(point.lambda[c] >= -1e-5f && point.lambda[c] <= 1 + 1e-5f);
        ASSERT_NEAR(place.corner.x + place.scale * point.lambda.y, lambda.y, 1e-5f)
            << n << " " << i << " " << j;
        ASSERT_NEAR(place.corner.y + place.scale * point.lambda.z, lambda.z, 1e-5f)
            << n << " " << i << " " << j;
      }
    EXPECT_EQ(seen.size(), size_t(n) * n) << "each sub-triangle holds points";
  }
}

TEST(Split, PairsOfARunNeitherOverlapNorLeaveTheirRows) {
  for (int level : {1, 2, 7, 33, 64}) {
    const ivec2 pitch = l_pair_pitch(level);
    const ivec2 size = l_pair_size(level);
    EXPECT_TRUE(pitch.x % 2 == 0 && pitch.y % 2 == 0 && pitch.x - size.x <= 1 && pitch.y - size.y <= 1 &&
                pitch.x >= size.x && pitch.y >= size.y);
    std::set<std::pair<int, int>> places;
    for (int i = 0; i < 200; ++i) {
      const ivec2 at = l_pair_place(i, {210, 10}, 90, level, 320);
      EXPECT_TRUE(at.x + pitch.x <= 320 && (at.y == 10 ? at.x >= 210 : at.x % pitch.x == 0)) << level;
      EXPECT_TRUE(places.insert({at.x, at.y}).second) << level;
    }
  }
}

// A sample that is read where its own point lies gives itself; between samples the fetch stays inside.
TEST(Halves, PositionsAreTheInverseOfSamplesAndStayInside) {
  for (const int across : {1, 2, 5, 17, 128})
    for (const int along : {1, 3, 16, 100, 1024})
      for (const int code : {0, 20, 63}) {
        const float foot = foot_from_code(code);
        const ivec2 size = half_staircase(across, along);
        for (int half = 0; half < 2; ++half)
          for (int y = 0; y <= size.y; y += 1 + size.y / 40)
            for (int x = 0; x < staircase_row(y, size); ++x) {
              const HalfSample shown = half_weights({x, y}, across, along, half, foot);
              const HalfPoint point = half_point(shown.weights.x, shown.weights.y, foot);
              const bool inside = x * size.y + y * size.x <= size.x * size.y;
              for (const bool turned : {false, true}) {
                const vec2 at = half_position(point, across, along, turned);
                const ivec2 texel = half_texel({x, y}, size, turned);
                // On the height both halves have the sample.
                if (inside && point.half_number == half) {
                  ASSERT_NEAR(at.x, texel.x, 2e-3f * size.y)
                      << across << " " << along << " " << x << " " << y;
                  ASSERT_NEAR(at.y, texel.y, 1e-3f * size.y);
                }
                for (int corner = 0; corner < 4; ++corner) {
                  const vec2 nudge(at.x + (corner % 2 == 0 ? 1e-3f : 0.999f),
                                   at.y + (corner < 2 ? 1e-3f : 0.999f));
                  const ivec2 fetched{ivec2(floor(nudge))};
                  const vec2 weight = glm::fract(at);
                  const bool counts =
                      (corner % 2 == 0 || weight.x > 2e-3f) && (corner < 2 || weight.y > 2e-3f);
                  ASSERT_TRUE(!counts || staircase_contains(half_sample(fetched, size, turned), size))
                      << across << " " << along << " " << at.x << " " << at.y;
                }
              }
            }
      }
}

TEST(Halves, PointsBesideTheTriangleAreMovedIntoIt) {
  for (float base = -0.5f; base <= 1.5f; base += 0.05f)
    for (float up = -0.5f; up <= 1.5f; up += 0.05f)
      for (const int code : {0, 31, 63}) {
        const HalfPoint at = half_point(base, up, foot_from_code(code));
        EXPECT_TRUE(at.up >= 0 && at.out_along >= 0 && at.up + at.out_along <= 1 + 1e-6f);
      }
}

// A pixel's centre may lie many heights beside a sliver.
TEST(Halves, PointsBesideTheTriangleKeepTheirPlaceAlongTheBase) {
  for (const int code : {0, 20, 63}) {
    const float foot = foot_from_code(code);
    for (float along = 0; along <= 1; along += 0.05f) {
      const float top = std::min(along / foot, (1 - along) / (1 - foot));
      for (const float up : {-7.0f, -0.3f, 0.3f * top, top, 0.3f + top, 9.0f}) {
        const HalfPoint at = half_point(along - foot * up, up, foot);
        const float shown =
            at.half_number == 0 ? foot * (1 - at.out_along) : foot + (1 - foot) * at.out_along;
        EXPECT_NEAR(shown, along, 1e-5f) << foot << " " << up;
        EXPECT_NEAR(at.up, std::clamp(up, 0.0f, top), 1e-3f) << foot << " " << along;
      }
    }
  }
}

}  // namespace
}  // namespace tessera::atlas::addressing
