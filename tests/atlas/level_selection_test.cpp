#include "atlas/level_selection.h"
#include "atlas/placement.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace tessera::atlas {
namespace {

using scene::Footprint;

constexpr PatchTraits kLone{.triangle_count = 1}, kPair{.triangle_count = 2};
constexpr PatchTraits kMaskedPair{.triangle_count = 2, .masked = true};

Placement block(Level level, bool masked) {
  return {.kind = PlacementKind::block,
          .width = static_cast<uint16_t>(1u << level.log_w),
          .height = static_cast<uint16_t>(1u << level.log_h),
          .masked = masked};
}

Footprint rectangle(float u, float v) {
  return {u, v, u * v};
}

uint32_t texels(const LevelWish& wish) {
  return wish.single_color ? 0 : 1u << (wish.level.log_w + wish.level.log_h);
}

bool operator==(const LevelWish& a, const LevelWish& b) {
  return a.single_color == b.single_color && a.level == b.level && a.transposed == b.transposed;
}

bool is_valid(const LevelWish& wish, const LevelSettings& settings) {
  return wish.single_color || (kMinLog <= wish.level.log_h && wish.level.log_h <= wish.level.log_w &&
                               wish.level.log_w <= settings.max_log);
}

std::vector<float> extreme_values() {
  const float inf = std::numeric_limits<float>::infinity();
  std::vector<float> values{0.0f,
                            -0.0f,
                            -1.0f,
                            std::numeric_limits<float>::denorm_min(),
                            std::numeric_limits<float>::min(),
                            std::numeric_limits<float>::max(),
                            inf,
                            -inf,
                            std::numeric_limits<float>::quiet_NaN()};
  for (int exponent = -20; exponent <= 30; ++exponent)
    values.push_back(std::exp2(0.7f * static_cast<float>(exponent)));
  return values;
}

TEST(LevelSelection, IsTotal) {
  const std::vector<float> values = extreme_values();
  for (const uint8_t max_log : {1, 2, 3, 5, 8}) {
    const LevelSettings settings{.max_log = max_log};
    const LevelWish previous{false, {max_log, kMinLog}, true};
    for (const float u : values) {
      for (const float v : values) {
        for (const float area : values) {
          for (const PatchTraits& traits : {kLone, kPair, kMaskedPair}) {
            const Footprint footprint{u, v, area};
            ASSERT_TRUE(std::isfinite(ideal_area(footprint, traits)));
            ASSERT_GE(ideal_area(footprint, traits), 0);
            for (const float bias : {-2.0f, 0.0f, 16.0f}) {
              ASSERT_TRUE(is_valid(select_level(footprint, traits, bias, nullptr, settings), settings));
              ASSERT_TRUE(is_valid(select_level(footprint, traits, bias, &previous, settings), settings));
            }
          }
        }
      }
    }
  }
}

TEST(LevelSelection, NanCountsAsZero) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(ideal_area({nan, nan, nan}, kPair), 0);
  EXPECT_TRUE(select_level({nan, nan, nan}, kPair, 0, nullptr, {}).single_color);
}

// About one texel a pixel, in both axes: rounding of the area and of the aspect move a side by 0.75 octaves
// at most.
TEST(LevelSelection, BlocksMatchFootprintsInBothAxes) {
  for (float u = 4; u <= 150; u *= 1.07f) {
    for (float v = 4; v <= 150; v *= 1.07f) {
      const LevelWish wish = select_level(rectangle(u, v), kPair, 0, nullptr, {});
      ASSERT_FALSE(wish.single_color);
      const float along_u = wish.transposed ? wish.level.log_h : wish.level.log_w;
      const float along_v = wish.transposed ? wish.level.log_w : wish.level.log_h;
      EXPECT_NEAR(along_u, std::log2(u), 0.7501f) << u << " x " << v;
      EXPECT_NEAR(along_v, std::log2(v), 0.7501f) << u << " x " << v;
      EXPECT_NEAR(along_u + along_v, std::log2(u * v), 0.5001f) << u << " x " << v;
    }
  }
}

// They are higher than their footprint by far, and pay for that.
TEST(LevelSelection, SliversPayForTheirHeightWithTheirLength) {
  for (float u = 8; u <= 120; u *= 1.13f) {
    for (const float v : {0.25f, 0.5f, 1.0f, 1.9f}) {
      const LevelWish wish = select_level(rectangle(u, v), kPair, 0, nullptr, {});
      EXPECT_FALSE(wish.single_color);
      EXPECT_EQ(wish.level.log_h, kMinLog);
      EXPECT_NEAR(wish.level.log_w + wish.level.log_h, std::max(2.0f, std::log2(u * v)), 0.5001f)
          << u << " x " << v;
      EXPECT_FALSE(wish.transposed);
      const LevelWish high = select_level(rectangle(v, u), kPair, 0, nullptr, {});
      EXPECT_EQ(high.level, wish.level);
      EXPECT_TRUE(high.transposed || high.level.log_w == kMinLog);
      // As of any other patch, its area tells when one colour is enough.
      const float color_bias = std::log2(u * v / LevelSettings{}.color_area_px2);
      EXPECT_FALSE(select_level(rectangle(u, v), kPair, color_bias - 0.01f, nullptr, {}).single_color);
      EXPECT_TRUE(select_level(rectangle(u, v), kPair, color_bias + 0.01f, nullptr, {}).single_color);
    }
  }
}

TEST(LevelSelection, MirroredFootprintsGetMirroredBlocks) {
  for (const PatchTraits& traits : {kLone, kPair, kMaskedPair}) {
    for (float u = 1; u <= 600; u *= 1.31f) {
      for (float v = 1; v < u; v *= 1.17f) {
        const LevelWish wide = select_level(rectangle(u, v), traits, 0, nullptr, {});
        const LevelWish high = select_level(rectangle(v, u), traits, 0, nullptr, {});
        EXPECT_EQ(wide.level, high.level);
        EXPECT_FALSE(wide.transposed);
        if (high.transposed) continue;
        // Equal sides of the colour part, or no block.
        const Placement p = block(high.level, traits.masked);
        EXPECT_TRUE(high.single_color || p.color_width() == p.color_height());
      }
    }
  }
}

TEST(LevelSelection, LoneTrianglesUseHalfOfTheirBlock) {
  const Footprint lone{16, 16, 128}, pair{16, 16, 256};
  EXPECT_EQ(ideal_area(lone, kLone), ideal_area(pair, kPair));
  EXPECT_TRUE(select_level(lone, kLone, 0, nullptr, {}) == select_level(pair, kPair, 0, nullptr, {}));
}

TEST(LevelSelection, MaskedPatchesKeepTheirColorResolution) {
  for (float u = 4; u <= 100; u *= 1.07f) {
    for (float v = 4; v <= 100; v *= 1.07f) {
      EXPECT_EQ(ideal_area(rectangle(u, v), kMaskedPair), 2 * ideal_area(rectangle(u, v), kPair));
      const LevelWish opaque = select_level(rectangle(u, v), kPair, 0, nullptr, {});
      const LevelWish masked = select_level(rectangle(u, v), kMaskedPair, 0, nullptr, {});
      const Placement p = block(masked.level, true);
      EXPECT_EQ(p.color_width(), 1u << opaque.level.log_w);
      EXPECT_EQ(p.color_height(), 1u << opaque.level.log_h);
      EXPECT_EQ(masked.transposed, opaque.transposed);
    }
  }
}

// Both halves own their chroma samples; only a superblock of 2 texels cannot hold two such halves.
TEST(LevelSelection, HalvesOfMaskedBlocksAreAtLeastTwoTexels) {
  for (const uint8_t max_log : {2, 4, 8}) {
    for (float u = 0.1f; u < 4000; u *= 1.2f) {
      for (float v = 0.1f; v < 4000; v *= 1.2f) {
        const LevelWish wish = select_level(rectangle(u, v), kMaskedPair, 0, nullptr, {.max_log = max_log});
        if (wish.single_color) continue;
        const Placement p = block(wish.level, true);
        EXPECT_GE(p.color_width(), 2u);
        EXPECT_GE(p.color_height(), 2u);
      }
    }
  }
}

TEST(LevelSelection, LargestBlocksAreSuperblocks) {
  for (const PatchTraits& traits : {kPair, kMaskedPair}) {
    EXPECT_EQ(select_level(rectangle(1e5f, 1e5f), traits, 0, nullptr, {.max_log = 6}).level, (Level{6, 6}));
  }
}

TEST(LevelSelection, BiasHalvesTheAreaPerUnit) {
  const Footprint footprint = rectangle(64, 64);
  for (int bias = -2; bias <= 10; ++bias) {
    EXPECT_EQ(texels(select_level(footprint, kPair, static_cast<float>(bias), nullptr, {})),
              1u << (12 - bias));
  }
}

TEST(LevelSelection, SmallAreasBecomeColors) {
  EXPECT_TRUE(select_level(rectangle(1.2f, 1.2f), kPair, 0, nullptr, {}).single_color);
  EXPECT_EQ(select_level(rectangle(1.3f, 1.3f), kPair, 0, nullptr, {}).level, (Level{1, 1}));
  EXPECT_TRUE(select_level(rectangle(1.3f, 1.3f), kPair, 1, nullptr, {}).single_color);
}

// A footprint that sways around the border between any two levels changes at most once.
TEST(LevelSelection, HysteresisStopsFlicker) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> log_side(-2, 9), sway(-0.08f, 0.08f);
  for (int run = 0; run < 3000; ++run) {
    const float u_log = log_side(random), v_log = log_side(random);
    const PatchTraits& traits = run % 3 == 0 ? kLone : run % 3 == 1 ? kPair : kMaskedPair;
    LevelWish previous;
    int changes = 0;
    for (int frame = 0; frame < 60; ++frame) {
      const float u = std::exp2(u_log + sway(random)), v = std::exp2(v_log + sway(random));
      const LevelWish wish = select_level(rectangle(u, v), traits, 0, frame > 0 ? &previous : nullptr, {});
      changes += frame > 0 && !(wish == previous);
      previous = wish;
    }
    EXPECT_LE(changes, 1) << std::exp2(u_log) << " x " << std::exp2(v_log);
  }
}

TEST(LevelSelection, HysteresisFollowsRealChanges) {
  LevelWish wish = select_level(rectangle(16, 16), kPair, 0, nullptr, {});
  for (const float side : {32.0f, 128.0f, 16.0f, 1.0f, 8.0f}) {
    wish = select_level(rectangle(side, side), kPair, 0, &wish, {});
    EXPECT_TRUE(wish == select_level(rectangle(side, side), kPair, 0, nullptr, {})) << side;
  }
  wish = select_level(rectangle(64, 16), kPair, 0, &wish, {});
  EXPECT_EQ(wish.level, (Level{6, 4}));
  wish = select_level(rectangle(16, 64), kPair, 0, &wish, {});
  EXPECT_TRUE(wish.transposed);
}

struct Population {
  std::vector<Footprint> footprints;
  std::vector<float> ideal_areas;
  double ideal = 0;
};

Population random_population(uint32_t seed, float median_area, float spread, size_t count = 20000) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  Population population;
  for (size_t i = 0; i < count; ++i) {
    const float area = median_area * std::exp(spread * normal(random)),
                ratio = std::exp(0.5f * normal(random));
    population.footprints.push_back({std::sqrt(area) * ratio, std::sqrt(area) / ratio, area});
    population.ideal_areas.push_back(ideal_area(population.footprints.back(), kPair));
    population.ideal += population.ideal_areas.back();
  }
  return population;
}

double texels_in_use(const Population& population, float bias, const LevelSettings& settings) {
  double sum = 0;
  for (const Footprint& f : population.footprints)
    sum += texels(select_level(f, kPair, bias, nullptr, settings));
  return sum;
}

TEST(SelectBias, ExpectedUseMeetsTheTarget) {
  const LevelSettings settings;
  for (const float median : {4.0f, 40.0f, 400.0f}) {
    for (const float spread : {0.5f, 1.5f, 3.0f}) {
      const Population population = random_population(3, median, spread);
      const double most = texels_in_use(population, settings.min_bias, settings);
      for (double share = 0.9; share > 0.01; share *= 0.6) {
        const float bias = select_bias(population.ideal_areas, share * most, settings);
        const double used = texels_in_use(population, bias, settings);
        // Where most blocks have the smallest size already, a step of the bias removes many at once.
        if (bias > std::log2(median)) continue;
        EXPECT_NEAR(used / (share * most), 1, 0.05) << median << ", " << spread << ", " << share;
      }
    }
  }
}

TEST(SelectBias, IsEquation33WhereNothingIsClamped) {
  std::vector<float> areas;
  for (int i = 0; i < 10000; ++i) areas.push_back(std::exp2(9.0f + 2.0f * static_cast<float>(i) / 10000));
  double ideal = 0;
  for (const float area : areas) ideal += area;
  for (const double bias : {-1.0, 0.0, 0.7, 2.0, 4.0}) {
    // Rounding a logarithm adds 0 to 4 % to these areas.
    EXPECT_NEAR(select_bias(areas, ideal * std::exp2(-bias), {}), bias + 0.03, 0.05);
  }
}

TEST(SelectBias, IsMonotonicInTheTarget) {
  const LevelSettings settings;
  for (uint32_t seed = 0; seed < 10; ++seed) {
    const Population population = random_population(seed, 20, 2, 500);
    float previous = settings.max_bias;
    for (double target = 0; target < 4 * population.ideal; target += population.ideal / 300) {
      const float bias = select_bias(population.ideal_areas, target, settings);
      EXPECT_LE(bias, previous);
      previous = bias;
    }
    EXPECT_LT(previous, 0);
  }
}

TEST(SelectBias, StaysInItsRange) {
  const LevelSettings settings;
  EXPECT_EQ(select_bias({}, 1e6, settings), settings.min_bias);
  EXPECT_EQ(select_bias({}, 0, settings), settings.min_bias);
  const float inf = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(select_bias(std::vector<float>{0, -1, nan}, 0, settings), settings.min_bias);
  EXPECT_EQ(select_bias(std::vector<float>{inf, 1e30f}, 100, settings), settings.max_bias);
  EXPECT_EQ(select_bias(std::vector<float>{100, 100}, nan, settings), settings.max_bias);
  EXPECT_EQ(select_bias(std::vector<float>(1000, 64.0f), -5, settings), settings.max_bias);
}

TEST(LeastBias, IsTheSameWhereverTheSearchBegins) {
  const LevelSettings settings{.min_bias = -2, .max_bias = 6.3f};
  for (const float limit : {-5.0f, -2.0f, -1.99f, 0.0f, 0.7f, 6.29f, 6.3f, 9.0f}) {
    const auto fits = [&](float bias) { return bias >= limit; };
    const float expected = std::clamp(std::ceil(limit * 64) / 64, settings.min_bias, settings.max_bias);
    for (const float near : {-1e9f, -2.0f, -1.98f, 0.0f, 0.7f, 3.0f, 6.3f, 1e9f})
      EXPECT_EQ(least_bias(settings, fits, near), expected) << limit << " from " << near;
  }
}

TEST(LeastBias, LooksFewTimesNearTheAnswer) {
  for (const float limit : {-1.5f, 0.0f, 4.0f}) {
    int looks = 0;
    const auto fits = [&](float bias) {
      ++looks;
      return bias >= limit;
    };
    EXPECT_EQ(least_bias({.min_bias = -2, .max_bias = 6}, fits, limit + 1.0f / 32), limit);
    EXPECT_LE(looks, 5);
  }
}

TEST(AdaptiveTarget, ShrinksAtOnceAndGrowsSlowly) {
  AdaptiveTarget target(1e6);
  const double start = target.texels();
  EXPECT_LT(start, 1e6);
  target.on_out_of_memory();
  EXPECT_LT(target.texels(), 0.95 * start);
  const double low = target.texels();
  for (int i = 0; i < 10; ++i) target.on_quiet_frame();
  EXPECT_EQ(target.texels(), low);
  for (int i = 0; i < 100000; ++i) target.on_quiet_frame();
  EXPECT_GT(target.texels(), start);
  EXPECT_LT(target.texels(), 1e6);
  for (int i = 0; i < 1000; ++i) target.on_out_of_memory();
  EXPECT_GT(target.texels(), 0);
}

TEST(AdaptiveTarget, RunningOutRestartsTheQuietTime) {
  AdaptiveTarget often(1e6);
  for (int i = 0; i < 100; ++i) {
    often.on_out_of_memory();
    const double low = often.texels();
    for (int frame = 0; frame < 60; ++frame) often.on_quiet_frame();
    EXPECT_EQ(often.texels(), low);
  }
}

TEST(AdaptiveTarget, GrowsOnceForEachPatience) {
  for (const int patience : {1, 15, 90}) {
    AdaptiveTarget target(1000, 0.5, patience);
    for (int frame = 1; frame <= 4 * patience; ++frame) {
      target.on_quiet_frame();
      EXPECT_NEAR(target.texels(), 500 + 10 * (frame / patience), 1e-6) << patience << ", frame " << frame;
    }
  }
}

}  // namespace
}  // namespace tessera::atlas
