#version 460
#extension GL_GOOGLE_include_directive : require
// Depth of alpha-masked materials: cut-away samples leave none.
#include "shading/shaders/material.glsl"
#include "shading/shaders/view.glsl"

void main() {
  Triangle t = fetch_triangle(draw.stand, draw.first_triangle + uint(gl_PrimitiveID));
  SurfacePoint p = texture_point(t, triangle_point(t, sample_position(gl_FragCoord)));
  if (base_color(p).a < material.alpha_cutoff) discard;
}
