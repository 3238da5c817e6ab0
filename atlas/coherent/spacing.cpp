#include "atlas/coherent/spacing.h"

#include <algorithm>
#include <cstdlib>

namespace tessera::atlas::coherent {
namespace {

double distance_to(const scene::Geometry& geometry, uint32_t index, const dmat4& transform,
                   const dvec3& eye) {
  const dvec3 position(geometry.vertices[geometry.indices[index]].position);
  return glm::length(dvec3(transform * glm::dvec4(position, 1)) - eye);
}

}  // namespace

Spacing spacing_for(const scene::Geometry& geometry, const scene::Patch& patch, const dmat4& transform,
                    const dvec3& eye) {
  const uint32_t first = 3 * patch.first_triangle;
  const double reference = distance_to(geometry, first, transform, eye);
  Spacing spacing{};
  if (!(reference > 0)) return spacing;
  // Corners 1..4 by index within the patch (scene::Patch).
  constexpr uint32_t kCorners[] = {1, 2, 3, 7};
  for (uint32_t c = 0; c < patch.triangle_count + 1; ++c)
    spacing[c] = spacing_code(distance_to(geometry, first + kCorners[c], transform, eye) / reference);
  return spacing;
}

bool still_good(const Spacing& held, const Spacing& wanted) {
  constexpr int kTolerance = 21;  // codes: an octave
  for (size_t i = 0; i < held.size(); ++i)
    if (std::abs(held[i] - wanted[i]) > kTolerance) return false;
  return true;
}

}  // namespace tessera::atlas::coherent
