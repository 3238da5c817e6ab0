// Triangles as an eye sees them: angles between the directions to their corners (thesis eq. 3.1).
#pragma once

#include <algorithm>
#include <cmath>

#include "base/math.h"

namespace tessera {

// Lengths near the ends of double's range would square out of it.
inline dvec3 scaled_to_one(const dvec3& v) {
  const double largest = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
  return largest > 0 ? v / largest : v;
}

// Radians. acos of a dot product loses all digits for small angles; this does not. 0 where one of them is 0.
// For vectors whose squares are in double's range.
inline double angle_between(const dvec3& a, const dvec3& b) {
  return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
}

// Heron's formula as ordered by Kahan: exact to rounding for slivers too. 0 where no triangle has these
// sides.
inline double area_from_sides(double a, double b, double c) {
  if (a < b) std::swap(a, b);
  if (b < c) std::swap(b, c);
  if (a < b) std::swap(a, b);
  const double square = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c));
  return square > 0 ? 0.25 * std::sqrt(square) : 0;
}

}  // namespace tessera
