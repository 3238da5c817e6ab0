#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include "tessellator.h"

namespace tessera::atlas::addressing::test {
namespace {

struct Less {
  bool operator()(ivec2 a, ivec2 b) const { return std::tie(a.x, a.y) < std::tie(b.x, b.y); }
};
using Texels = std::set<ivec2, Less>;

float largest(vec3 v) {
  return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
}

Texels region(int level) {
  Texels texels;
  for (int y = -2; y <= level + 2; ++y)
    for (int x = -2; x <= level + 2; ++x)
      if (l_contains(ivec2(x, y), level)) texels.insert(ivec2(x, y));
  return texels;
}

// One texel a sample and none of two samples' but the copies along the cut; every texel of the L is some
// sample's.
void expect_exact_cover(const std::vector<vec3>& samples, int level) {
  Texels used;
  int copies = 0;
  for (const vec3& sample : samples) {
    const LTexels at = l_texels(sample, level);
    ASSERT_TRUE(used.insert(at.texel).second) << "two samples in one texel at level " << level;
    if (at.copy == at.texel) continue;
    ++copies;
    ASSERT_TRUE(used.insert(at.copy).second) << "a copy over a sample at level " << level;
  }
  EXPECT_EQ(used, region(level)) << level;
  EXPECT_EQ(copies, (level + 1) / 2) << level;
  EXPECT_LE(copies, 32);
}

TEST(LPacking, SamplesFillTheLWithoutCollisions) {
  for (int level = 1; level <= kMaxTessellationLevel; ++level)
    expect_exact_cover(tessellated(uniform_levels(level)), level);
}

TEST(LPacking, SamplesFillTheLAsTheTessellatorGivesThem) {
  for (int level = 1; level <= kMaxTessellationLevel; ++level) {
    const std::vector<vec3> exact = tessellated(uniform_levels(level));
    for (uint32_t seed = 0; seed < 8; ++seed) {
      const std::vector<vec3> given = perturbed(exact, level, seed);
      expect_exact_cover(given, level);
      for (size_t i = 0; i < exact.size(); ++i) {
        const LTexels a = l_texels(exact[i], level), b = l_texels(given[i], level);
        ASSERT_TRUE(a.texel == b.texel && a.copy == b.copy) << level;
      }
    }
  }
}

TEST(LPacking, TexelsGiveTheirSamplesBack) {
  for (int level = 1; level <= kMaxTessellationLevel; ++level) {
    for (const vec3& sample : tessellated(uniform_levels(level))) {
      const LTexels at = l_texels(sample, level);
      EXPECT_LT(largest(l_barycentric(at.texel, level) - sample), 1e-6f) << level;
      EXPECT_LT(largest(l_barycentric(at.copy, level) - sample), 1e-6f) << level;
    }
  }
}

TEST(LPacking, SamplesOfTexelsReturnToThem) {
  for (int level = 1; level <= kMaxTessellationLevel; ++level) {
    for (const ivec2& texel : region(level)) {
      const LTexels at = l_texels(l_barycentric(texel, level), level);
      EXPECT_TRUE(at.texel == texel || at.copy == texel) << level << ": " << texel.x << ", " << texel.y;
    }
  }
}

TEST(LPacking, PositionsOfSamplesAreTheirTexels) {
  for (int level = 1; level <= kMaxTessellationLevel; ++level) {
    for (const vec3& sample : tessellated(uniform_levels(level))) {
      const LTexels at = l_texels(sample, level);
      const vec2 position = l_position(sample, level);
      const ivec2 nearest(floor(position + 0.5f));
      ASSERT_TRUE(nearest == at.texel || nearest == at.copy) << level;
      EXPECT_LT(glm::length(position - vec2(nearest)), 1e-4f) << level;
    }
  }
}

// An L whose texels hold a function that is linear over the triangle, read bilinearly.
class ReadL {
 public:
  ReadL(int level, vec3 corners) : level_(level), corners_(corners) {}

  float truth(vec3 lambda) const { return glm::dot(corners_, lambda); }
  float read(vec3 lambda) const {
    const vec2 at = l_position(lambda, level_);
    const ivec2 first(floor(at));
    const vec2 f = at - vec2(first);
    float sum = 0;
    for (int corner = 0; corner < 4; ++corner) {
      const ivec2 offset(corner & 1, corner >> 1);
      const float weight = (offset.x == 1 ? f.x : 1 - f.x) * (offset.y == 1 ? f.y : 1 - f.y);
      if (weight == 0) continue;
      EXPECT_TRUE(l_contains(first + offset, level_)) << level_ << ": " << at.x << ", " << at.y;
      sum += weight * truth(l_barycentric(first + offset, level_));
    }
    return sum;
  }

 private:
  int level_;
  vec3 corners_;
};

// The four texels lie on both sides of a tip's diagonal.
bool reads_across_fold(vec3 lambda, int level) {
  const Tips tips = sorted_tips(lambda);
  const auto l = static_cast<float>(level);
  // As close to it as rounding can tell.
  return floor(l_row(lambda, tips, l) + 1e-4f) >= floor(l_column(lambda, tips, l) - 1e-4f);
}

constexpr int kDense = 200;

template <class F>
void for_dense_points(F&& visit) {
  for (int i = 0; i <= kDense; ++i)
    for (int j = 0; i + j <= kDense; ++j) visit(vec3(i, j, kDense - i - j) / static_cast<float>(kDense));
}

TEST(LPacking, BilinearReadsStayInTheLAndReproduceWhatIsLinear) {
  for (int level = 1; level <= kMaxTessellationLevel; ++level) {
    const auto step = 1.0f / static_cast<float>(level);
    float worst = 0, worst_at_fold = 0;
    for (const vec3& corners : {vec3(1, 0, 0), vec3(0, 1, 0), vec3(0, 0, 1)}) {
      const ReadL l(level, corners);
      for_dense_points([&](vec3 lambda) {
        const float error = std::abs(l.read(lambda) - l.truth(lambda));
        float& most = reads_across_fold(lambda, level) ? worst_at_fold : worst;
        most = std::max(most, error);
      });
    }
    EXPECT_LT(worst, 1e-6f) << level;
    EXPECT_LT(worst_at_fold, step / 6 + 1e-6f) << level;
  }
}

// Both sides of the cut at odd levels, where reading goes on in the copied column.
TEST(LPacking, TheCutOfOddLevelsIsNoSeam) {
  for (int level = 3; level <= kMaxTessellationLevel; level += 2) {
    const ReadL l(level, vec3(0.25f, -1, 2));
    const float half_step = 0.5f / static_cast<float>(level);
    for (int i = 0; i <= 1000; ++i) {
      // From the edge opposite corner 0 to where the texels of the middle begin.
      const float x = static_cast<float>(i) / 1000 * (1 - 3 * half_step) / 3;
      const float y = 0.5f * (1 - x);
      for (const float side : {-1.0f, -0.5f, -1e-3f, 1e-3f, 0.5f, 1.0f}) {
        const float d = side * half_step * 0.5f;
        const vec3 lambda(x, y - d, y + d);
        if (reads_across_fold(lambda, level)) continue;
        EXPECT_NEAR(l.read(lambda), l.truth(lambda), 3e-6f) << level << " " << i << " " << side;
      }
    }
  }
}

TEST(LPacking, ReadsBesideTheTriangleStayInTheL) {
  for (int level = 1; level <= kMaxTessellationLevel; ++level) {
    const ReadL l(level, vec3(1));
    const float reach = 1.0f / static_cast<float>(level);
    for_dense_points([&](vec3 lambda) {
      for (int corner = 0; corner < 3; ++corner) {
        vec3 beside = lambda;
        beside[corner] -= reach;
        beside[(corner + 1) % 3] += 0.75f * reach;
        beside[(corner + 2) % 3] += 0.25f * reach;
        l.read(beside);
      }
    });
  }
}

TEST(LPacking, PairsFillTheirRectangle) {
  for (int level = 1; level <= kMaxTessellationLevel; ++level) {
    const ivec2 size = l_pair_size(level);
    std::map<ivec2, std::pair<bool, ivec2>, Less> filled;
    for (const bool turned : {false, true}) {
      for (const ivec2& texel : region(level)) {
        const ivec2 at = l_pair_texel(texel, turned, level);
        ASSERT_TRUE(at.x >= 0 && at.y >= 0 && at.x < size.x && at.y < size.y) << level;
        ASSERT_TRUE(filled.insert({at, {turned, texel}}).second) << "the two overlap at level " << level;
        ASSERT_EQ(l_pair_texel(at, turned, level), texel);
      }
    }
    const int empty = size.x * size.y - static_cast<int>(filled.size());
    EXPECT_EQ(empty, level % 2 == 0 ? level + 2 : 0);
    for (int y = 0; y < size.y; ++y) {
      for (int x = 0; x < size.x; ++x) {
        const LPairTexel owner = l_pair_owner(ivec2(x, y), level);
        const auto found = filled.find(ivec2(x, y));
        ASSERT_EQ(owner.empty, found == filled.end()) << level << ": " << x << ", " << y;
        if (owner.empty) continue;
        EXPECT_EQ(owner.turned, found->second.first);
        EXPECT_EQ(owner.texel, found->second.second);
      }
    }
  }
}

TEST(LPacking, PairsAreAsFullAsTheyCanBe) {
  const auto fill = [](int level) {
    const ivec2 size = l_pair_size(level);
    return 2.0 * tessellation_vertices(level) / (size.x * size.y);
  };
  EXPECT_NEAR(fill(1), 0.75, 0.005);
  EXPECT_NEAR(fill(4), 0.79, 0.005);
  EXPECT_NEAR(fill(16), 0.93, 0.005);
  EXPECT_NEAR(fill(64), 0.98, 0.005);
}

TEST(LPacking, PositionsTurnLikeTexels) {
  for (const int level : {1, 2, 7, 64}) {
    for (const ivec2& texel : region(level)) {
      for (const bool turned : {false, true}) {
        const vec2 position = l_pair_position(vec2(texel), turned, level);
        EXPECT_EQ(position, vec2(l_pair_texel(texel, turned, level)));
        EXPECT_EQ(l_pair_position(position, turned, level), vec2(texel));
      }
    }
  }
}

}  // namespace
}  // namespace tessera::atlas::addressing::test
