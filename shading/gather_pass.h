// What all samples of a gather pass share: push constants of every gather shader.
#pragma once

#include "base/view.h"

namespace tessera::shading {

// Pass in shading/shaders/gather.glsl.
struct PassPush {
  vec4 eye, axis, ray_x, ray_y;
  uint32_t width = 0, height = 0;  // of the atlas
  uint32_t first_chunk = 0, end_chunk = 0;
};

inline PassPush pass_of(const View& viewer, const dvec3& origin) {
  const glm::dmat3 axes = glm::mat3_cast(viewer.pose.orientation);
  const Fov& fov = viewer.fov;
  return {.eye = vec4(vec3(viewer.pose.position - origin), 1),
          .axis = vec4(vec3(-axes[2]), 0),
          .ray_x = vec4(vec3(axes[0]) * ((fov.right - fov.left) / static_cast<float>(viewer.width)), 0),
          .ray_y = vec4(vec3(axes[1]) * ((fov.up - fov.down) / static_cast<float>(viewer.height)), 0)};
}

}  // namespace tessera::shading
