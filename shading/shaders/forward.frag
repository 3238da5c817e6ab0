#version 460
#extension GL_GOOGLE_include_directive : require
// Shades a sample: sRGB-encoded colour, alpha 1 = covered by geometry.
#include "shading/shaders/material.glsl"
#include "shading/shaders/view.glsl"

layout(constant_id = 30) const bool kMasked = false;  // the draw's material cuts away texels

layout(location = 0) out vec4 out_color;

void main() {
  Triangle t = fetch_triangle(draw.stand, draw.first_triangle + uint(gl_PrimitiveID));
  SurfacePoint p = surface_point(draw.stand, t, triangle_point(t, sample_position(gl_FragCoord)));
  MaterialPoint m = material_point(p);
  if (kMasked && m.base.a < material.alpha_cutoff) discard;
  out_color = vec4(srgb_encode_color(shade(p, m, view.eye.xyz)), 1.0);
}
