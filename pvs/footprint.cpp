#include <algorithm>
#include <array>
#include <cmath>

#include "pvs/visibility.h"

namespace tessera::pvs {
namespace {

// Lengths near the ends of double's range would square out of it.
dvec3 scaled_to_one(const dvec3& v) {
  const double largest = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
  return largest > 0 ? v / largest : v;
}

// Thesis eq. 3.1. acos of a dot product loses all digits for small angles; this does not. 0 where the eye is
// at a corner.
double angle_between(const dvec3& a, const dvec3& b) {
  return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
}

// Heron's formula as ordered by Kahan: exact to rounding for slivers too. 0 where no triangle has these
// sides.
double area_from_sides(double a, double b, double c) {
  if (a < b) std::swap(a, b);
  if (b < c) std::swap(b, c);
  if (a < b) std::swap(a, b);
  const double square = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c));
  return square > 0 ? 0.25 * std::sqrt(square) : 0;
}

}  // namespace

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
