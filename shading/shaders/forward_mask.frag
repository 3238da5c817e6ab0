#version 460
#extension GL_GOOGLE_include_directive : require
// Depth of alpha-masked materials: cut-away samples leave none.
#include "shading/shaders/material.glsl"
#include "shading/shaders/view.glsl"

void main() {
  vec2 pixel = floor(gl_FragCoord.xy) + gl_SamplePosition;
  Triangle t = fetch_triangle(draw.instance, draw.first_triangle + uint(gl_PrimitiveID));
  if (is_cut_away(texture_point(draw.material, t, triangle_point(t, pixel)))) discard;
}
