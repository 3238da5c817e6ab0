#version 460
#extension GL_GOOGLE_include_directive : require
// Alpha-masked casters. Zero gradients: a shadow texel is about as small as a texture's, and the shadow filter smooths.
#include "scene/shaders/scene.glsl"

layout(location = 0) flat in uint in_material;
layout(location = 1) in vec2 in_uv0;
layout(location = 2) in vec2 in_uv1;

void main() {
  float alpha = materials[in_material].base_color.a;
  TextureUse use = materials[in_material].base_color_texture;
  if (use.array != kNone) alpha *= sample_texture(use, texture_uv(use, in_uv0, in_uv1), vec2(0.0), vec2(0.0)).a;
  if (alpha < materials[in_material].alpha_cutoff) discard;
}
