// What the scene needs, as specialization constants: the terms that it does not need vanish from every shader.
// Values come from Lighting::constants(); the ids are those of shading/features.h.
#ifndef TESSERA_SHADING_FEATURES_GLSL
#define TESSERA_SHADING_FEATURES_GLSL

layout(constant_id = 10) const uint kDirectionalLights = 0;
layout(constant_id = 11) const uint kSunShadows = 0;   // 0 or 1: the first directional light casts a shadow
layout(constant_id = 12) const uint kSpotShadows = 0;  // the first of the local lights, which cast shadows
layout(constant_id = 13) const uint kGridLights = 0;   // the other local lights, found through the grid
layout(constant_id = 14) const bool kNormalMaps = false;
layout(constant_id = 15) const bool kMetallicRoughnessMaps = false;
layout(constant_id = 16) const bool kEmissive = false;
layout(constant_id = 17) const bool kOcclusionMaps = false;
layout(constant_id = 18) const bool kUnlit = false;
layout(constant_id = 19) const bool kDoubleSided = false;
layout(constant_id = 20) const bool kVertexColors = false;
layout(constant_id = 21) const bool kSecondTexcoord = false;

#endif
