// The records of shading/shaders/lighting.glsl as C++ (std140, std430). Keep the two files alike.
#pragma once

#include <cstdint>

#include "base/math.h"

namespace tessera::shading {

struct LightRecord {
  vec3 position;  // relative to the instant's origin
  float inverse_range;
  vec3 direction;
  float cone_scale;
  vec3 color;
  float cone_offset;
};
static_assert(sizeof(LightRecord) == 48);

struct ShadowRecord {
  mat4 clip_from_relative;
  vec2 rectangle_offset, rectangle_size;
  float texel_m;  // sun: metres; spot: metres per metre of distance
  float pad = 0;
  vec2 texel_size;  // of the image, in [0, 1]
};
static_assert(sizeof(ShadowRecord) == 96);

// Directional lights and shadowed spots together.
constexpr uint32_t kMaxLeadingLights = 16;
constexpr uint32_t kMaxGridLights = 256;

struct LightingRecord {
  vec3 ambient_sky;
  float exposure;
  vec4 ambient_ground;
  vec4 grid_min;
  vec4 grid_scale;
  uint32_t grid_size[3];
  uint32_t outside_cell;
  LightRecord leading_lights[kMaxLeadingLights];
  ShadowRecord shadows[kMaxLeadingLights];
};
static_assert(sizeof(LightingRecord) == 80 + kMaxLeadingLights * (48 + 96));

struct LightCell {
  uint32_t first, count;
};

}  // namespace tessera::shading
