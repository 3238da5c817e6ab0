// A GPU's square root may be off by some units in the last place (Vulkan 1.3, precision of core SPIR-V
// instructions: that of a reciprocal and a division, 5 in all). The shaders' text with such a root.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/glm.hpp>
#include <limits>

namespace tessera::atlas::addressing::inexact {
namespace {

using glm::ivec2, glm::ivec3, glm::vec3;
using glm::max, glm::min, glm::floor;

float relative_error = 0;
float sqrt(float x) {
  return std::sqrt(x) * (1 + relative_error);
}

#include "atlas/addressing/oversampling.glsl"

class InexactRoot : public testing::TestWithParam<int> {
 protected:
  void SetUp() override {
    relative_error = static_cast<float>(GetParam()) * std::numeric_limits<float>::epsilon();
  }
};

TEST_P(InexactRoot, StillGivesTheRightLevels) {
  for (int count = 4; count <= kMaxTessellationVertices; ++count) {
    const int inner = tessellation_levels(count).inner;
    ASSERT_GE(tessellation_vertices(inner), count);
    ASSERT_TRUE(inner == 2 || tessellation_vertices(inner - 1) < count) << count;
  }
}

TEST_P(InexactRoot, StillFindsTheRow) {
  for (int w = 1; w <= 128; ++w) {
    for (int h = w; h <= 1024; h += 13) {
      const ivec2 size(w, h);
      int id = 0;
      for (int y = 0; y <= h; ++y) {
        const int length = staircase_row(y, size);
        ASSERT_EQ(staircase_position(id, size), ivec2(0, y)) << w << "x" << h;
        ASSERT_EQ(staircase_position(id + length - 1, size), ivec2(length - 1, y)) << w << "x" << h;
        id += length;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Ulps, InexactRoot, testing::Values(-5, -1, 1, 5));

}  // namespace
}  // namespace tessera::atlas::addressing::inexact
