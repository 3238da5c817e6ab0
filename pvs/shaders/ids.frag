// Writes: the triangle's id. Masked materials drop fragments below their cut-off.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "scene/shaders/scene.glsl"

layout(constant_id = 1) const bool kMasked = false;

layout(location = 0) flat in uint first_id;
layout(location = 1) flat in uint material;
layout(location = 2) in vec3 uv_alpha;

layout(location = 0) out uint id;

void main() {
  if (kMasked) {
    MaterialRecord m = materials[material];
    float alpha = m.base_color.a * uv_alpha.z;
    if (m.base_color_texture.array != kNone) {
      alpha *= sample_texture(m.base_color_texture, uv_alpha.xy, dFdx(uv_alpha.xy), dFdy(uv_alpha.xy)).a;
    }
    if (alpha < m.alpha_cutoff) discard;
  }
  id = first_id + uint(gl_PrimitiveID);
}
