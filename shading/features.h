// The specialization constants of shading/shaders/features.glsl.
#pragma once

#include <cstdint>
#include <vector>

#include "gpu/pipeline.h"
#include "scene/scene.h"
#include "shading/light_list.h"

namespace tessera::shading {

enum FeatureId : uint32_t {
  kDirectionalLightsId = 10,
  kSunShadowsId,
  kSpotShadowsId,
  kGridLightsId,
  kNormalMapsId,
  kMetallicRoughnessMapsId,
  kEmissiveId,
  kOcclusionMapsId,
  kUnlitId,
  kDoubleSidedId,
  kVertexColorsId,
  kSecondTexcoordId,
  kMaskedDrawId = 30,  // of one pipeline, not of the scene
};

std::vector<gpu::Constant> feature_constants(const scene::Features& features, const LightPlan& lights);

}  // namespace tessera::shading
