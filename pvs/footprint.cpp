#include <algorithm>
#include <array>
#include <cmath>

#include "base/triangle_angles.h"
#include "pvs/visibility.h"

namespace tessera::pvs {
scene::Footprint footprint(const scene::Geometry& geometry, const scene::Patch& patch, const dmat4& transform,
                           const dvec3& eye, float pixels_per_radian) {
  double u_rad = 0, v_rad = 0, area_sr = 0;
  for (uint32_t t = 0; t < patch.triangle_count; ++t) {
    const uint32_t* indices = geometry.indices.data() + 3 * (size_t{patch.first_triangle} + t);
    std::array<dvec3, 3> to_corner;
    std::array<vec2, 3> corner;
    for (uint32_t c = 0; c < 3; ++c) {
      const glm::dvec4 world = transform * glm::dvec4(dvec3(geometry.vertices[indices[c]].position), 1.0);
      to_corner[c] = scaled_to_one(dvec3(world) - eye);
      corner[c] = scene::patch_corner(patch.triangle_count, t, c);
    }
    std::array<double, 3> side;
    for (uint32_t c = 0; c < 3; ++c) {
      const uint32_t next = (c + 1) % 3;
      side[c] = angle_between(to_corner[c], to_corner[next]);
      const vec2 run = glm::abs(corner[next] - corner[c]);
      // Per whole block side: the bottom of a patch of three consists of two half sides.
      if (run.y == 0) u_rad = std::max(u_rad, side[c] / run.x);
      if (run.x == 0) v_rad = std::max(v_rad, side[c] / run.y);
    }
    area_sr += area_from_sides(side[0], side[1], side[2]);
  }
  const double scale = pixels_per_radian;
  return {static_cast<float>(scale * u_rad), static_cast<float>(scale * v_rad),
          static_cast<float>(scale * scale * area_sr)};
}

}  // namespace tessera::pvs
