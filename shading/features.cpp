#include "shading/features.h"

namespace tessera::shading {

std::vector<gpu::Constant> feature_constants(const scene::Features& f, const LightPlan& lights) {
  return {{kDirectionalLightsId, lights.directional},
          {kSunShadowsId, lights.sun_shadows},
          {kSpotShadowsId, lights.spot_shadows},
          {kGridLightsId, lights.grid_lights()},
          {kNormalMapsId, f.normal_maps},
          {kMetallicRoughnessMapsId, f.metallic_roughness_maps},
          {kEmissiveId, f.emissive},
          {kOcclusionMapsId, f.occlusion_maps},
          {kUnlitId, f.unlit},
          {kDoubleSidedId, f.double_sided},
          {kVertexColorsId, f.vertex_colors},
          {kSecondTexcoordId, f.second_texcoord}};
}

}  // namespace tessera::shading
