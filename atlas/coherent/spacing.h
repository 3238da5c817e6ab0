// Spacing codes of a patch (atlas/placement.h).
#pragma once

#include <array>
#include <span>

#include "atlas/placement.h"
#include "base/math.h"

namespace tessera::atlas::coherent {

using Spacing = std::array<SpacingCode, 4>;

// For an eye in the geometry's space. Distances, not depths, weigh the corners: that is the perspective onto
// the plane through the corners' directions, which has no near plane and does not change as the head turns. A
// corner at the eye counts as 1/64 of the first's distance; codes are 0 where the first corner is at the eye.
Spacing spacing_for(const scene::Geometry& geometry, const scene::Patch& patch, const dmat4& transform,
                    const dvec3& eye);

// Are samples spaced by `held` still good where `wanted` is right?
bool still_good(const Spacing& held, const Spacing& wanted);

}  // namespace tessera::atlas::coherent
