// Where in the atlas the samples of a patch lie, and which point of the patch a texel shows. The functions
// are those of the shaders, in their own text: the .glsl files beside this one say what each does, its ranges
// and its source. All are pure.
#pragma once

#include <glm/glm.hpp>

namespace tessera::atlas::addressing {

using glm::clamp, glm::floor, glm::log2, glm::max, glm::min, glm::sqrt;
using glm::ivec2, glm::ivec3, glm::vec2, glm::vec3;

#include "atlas/addressing/block.glsl"
#include "atlas/addressing/halves.glsl"
#include "atlas/addressing/l_packing.glsl"
#include "atlas/addressing/oversampling.glsl"
#include "atlas/addressing/perspective.glsl"
#include "atlas/addressing/split.glsl"
#include "atlas/addressing/tessellation.glsl"
#undef INLINE

}  // namespace tessera::atlas::addressing
