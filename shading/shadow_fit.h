// What a shadow map covers.
#pragma once

#include "scene/gpu_scene.h"
#include "shading/light_list.h"

namespace tessera::shading {

struct ShadowFit {
  dmat4 clip_from_world{1};  // reversed depth
  double texel_m = 0;        // side of a texel: metres (sun) or metres per metre of distance (spot)
};

// Orthographic over the scene's main extent: what holds the central 98 % of the triangles across the light's
// direction (far mountains stay out), and the depth of all of them.
ShadowFit fit_sun(const scene::Scene& scene, const std::vector<dmat4>& transforms, const dvec3& direction,
                  uint32_t side_texels);

// The spot's cone, up to 170 degrees.
ShadowFit fit_spot(const PlacedLight& spot, uint32_t side_texels);

}  // namespace tessera::shading
