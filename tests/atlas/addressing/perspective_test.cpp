#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "atlas/addressing/addressing.h"

namespace tessera::atlas::addressing {
namespace {

constexpr float kRatios[] = {1.0f / 64, 0.1f, 0.7f, 1, 1.5f, 9, 64};

template <class F>
void for_points_and_ratios(F&& visit) {
  for (const float r1 : kRatios)
    for (const float r2 : kRatios)
      for (int i = 0; i <= 20; ++i)
        for (int j = 0; i + j <= 20; ++j) visit(vec3(i, j, 20 - i - j) / 20.0f, vec2(r1, r2));
}

// Where a triangle with corners at depth w shows the point `lambda` of its surface.
vec2 projected(const vec2 (&screen)[3], vec3 w, vec3 lambda) {
  vec2 sum(0);
  float depth = 0;
  for (int i = 0; i < 3; ++i) {
    sum += lambda[i] * w[i] * screen[i];
    depth += lambda[i] * w[i];
  }
  return sum / depth;
}

TEST(Perspective, EvenInTheGridIsEvenOnTheScreen) {
  const vec2 screen[3] = {vec2(0.2f, -0.5f), vec2(0.9f, 0.3f), vec2(-0.4f, 0.6f)};
  for_points_and_ratios([&](vec3 s, vec2 ratios) {
    const float w0 = 3;
    const vec2 seen = projected(screen, w0 * vec3(1, ratios), to_surface(s, ratios));
    const vec2 even = s.x * screen[0] + s.y * screen[1] + s.z * screen[2];
    EXPECT_LT(glm::length(seen - even), 1e-5f) << ratios.x << " " << ratios.y;
  });
}

TEST(Perspective, TheTwoDirectionsAreInverse) {
  for_points_and_ratios([&](vec3 p, vec2 ratios) {
    for (const vec3& there_and_back :
         {to_grid(to_surface(p, ratios), ratios), to_surface(to_grid(p, ratios), ratios)}) {
      EXPECT_LT(glm::length(there_and_back - p), 2e-6f) << ratios.x << " " << ratios.y;
      EXPECT_NEAR(there_and_back.x + there_and_back.y + there_and_back.z, 1, 1e-6f);
    }
  });
}

TEST(Perspective, OrthographicChangesNothing) {
  for_points_and_ratios([&](vec3 p, vec2) {
    EXPECT_LT(glm::length(to_surface(p, vec2(1)) - p), 1e-7f);
    EXPECT_LT(glm::length(to_grid(p, vec2(1)) - p), 1e-7f);
  });
}

TEST(Perspective, CornersAndEdgesStayTheirOwn) {
  for_points_and_ratios([&](vec3 p, vec2 ratios) {
    for (const vec3& moved : {to_surface(p, ratios), to_grid(p, ratios)}) {
      for (int i = 0; i < 3; ++i) {
        EXPECT_EQ(p[i] == 0, moved[i] == 0);
        EXPECT_NEAR(moved[i], 1, p[i] == 1 ? 1e-6f : 1);
        EXPECT_GE(moved[i], 0);
      }
    }
  });
}

TEST(Perspective, AsADepthVanishesItsCornerDrawsAllSamples) {
  const vec3 s(0.3f, 0.3f, 0.4f);
  vec3 last_surface(0), last_grid(1);
  for (float ratio = 1; ratio > 1e-30f; ratio /= 2) {
    const vec3 surface = to_surface(s, vec2(ratio, 1)), grid = to_grid(s, vec2(ratio, 1));
    EXPECT_GE(surface.y, last_surface.y);
    EXPECT_LE(grid.y, last_grid.y);
    last_surface = surface;
    last_grid = grid;
  }
  EXPECT_FLOAT_EQ(last_surface.y, 1);
  EXPECT_NEAR(last_grid.y, 0, 1e-20f);
  // At the limit itself, of every corner.
  EXPECT_EQ(to_surface(s, vec2(0, 1)), vec3(0, 1, 0));
  EXPECT_EQ(to_surface(s, vec2(1, 0)), vec3(0, 0, 1));
  EXPECT_LT(glm::length(to_surface(s, vec2(1e15f)) - vec3(1, 0, 0)), 1e-6f);
}

TEST(RatioCode, EveryCodeReturns) {
  for (int code = 0; code <= kRatioCodeMax; ++code) {
    EXPECT_EQ(ratio_code(ratio_from_code(code)), code);
    EXPECT_EQ(ratio_from_code(code) > ratio_from_code(code - 1), code > 0);
    const double exact = std::exp2((code - kRatioCodeOne) / static_cast<double>(kRatioCodesPerOctave));
    EXPECT_NEAR(ratio_from_code(code) / exact, 1, 3e-7);
  }
}

TEST(RatioCode, PowersOfTwoAreExact) {
  for (int octave = -6; octave <= 6; ++octave) {
    const int code = kRatioCodeOne + octave * kRatioCodesPerOctave;
    EXPECT_EQ(ratio_code(std::ldexp(1.0f, octave)), code);
    EXPECT_EQ(ratio_from_code(code), std::ldexp(1.0f, octave));
  }
  EXPECT_EQ(ratio_from_code(kRatioCodeOne), 1);
}

TEST(RatioCode, IsOffByHalfAStepAtMost) {
  const double bound = std::exp2(0.5 / kRatioCodesPerOctave) * (1 + 1e-6);
  for (double ratio = 1.0 / 64; ratio <= 64; ratio *= 1.0003) {
    const double error = ratio_from_code(ratio_code(static_cast<float>(ratio))) / ratio;
    EXPECT_LE(error, bound) << ratio;
    EXPECT_GE(error, 1 / bound) << ratio;
  }
}

TEST(RatioCode, WhatIsOutOfRangeIsLimited) {
  const float infinity = std::numeric_limits<float>::infinity();
  for (const float ratio : {0.0f, -1.0f, 1e-30f, 1.0f / 65, -infinity, std::nanf("")})
    EXPECT_EQ(ratio_code(ratio), 0) << ratio;
  for (const float ratio : {65.0f, 1e30f, infinity}) EXPECT_EQ(ratio_code(ratio), kRatioCodeMax) << ratio;
  EXPECT_EQ(ratio_from_code(255), 64);
  EXPECT_EQ(ratio_from_code(-1), 1.0f / 64);
}

}  // namespace
}  // namespace tessera::atlas::addressing
