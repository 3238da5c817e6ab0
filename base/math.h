// The project's linear algebra: glm, column vectors, right-handed, +Y up, cameras look along -Z (as in glTF).
#pragma once

#include <glm/glm.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>

namespace tessera {

using glm::dmat4;
using glm::dquat;
using glm::dvec3;
using glm::ivec2;
using glm::ivec3;
using glm::mat3;
using glm::mat4;
using glm::quat;
using glm::uvec2;
using glm::vec2;
using glm::vec3;
using glm::vec4;

// An axis-aligned box; empty while min > max.
struct Aabb {
  vec3 min{std::numeric_limits<float>::infinity()};
  vec3 max{-std::numeric_limits<float>::infinity()};

  void add(vec3 p) {
    min = glm::min(min, p);
    max = glm::max(max, p);
  }
  void add(const Aabb& b) {
    min = glm::min(min, b.min);
    max = glm::max(max, b.max);
  }
  bool empty() const { return min.x > max.x; }
  vec3 center() const { return 0.5f * (min + max); }
  vec3 extent() const { return max - min; }
};

}  // namespace tessera
