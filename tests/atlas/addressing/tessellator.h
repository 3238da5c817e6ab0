// What a tessellator makes of a triangle, without one: the points of the specification, and points as far
// from them as those of a device.
#pragma once

#include <cstdint>
#include <vector>

#include "atlas/addressing/addressing.h"

namespace tessera::atlas::addressing::test {

// Equal spacing. Not for an inside of 1 with outer levels above, which the tessellator takes for 2.
std::vector<vec3> tessellated(const TessellationLevels& levels);

// How far gl_TessCoord times the level was found from a whole number.
constexpr float kTessCoordError = 0.0103f;

// The same points with errors of up to kTessCoordError / level in every coordinate, drawn from `seed`;
// coordinates are then multiples of 2^-16. Corners stay, and points of an edge stay on it.
std::vector<vec3> perturbed(std::vector<vec3> points, int level, uint32_t seed);

}  // namespace tessera::atlas::addressing::test
