#version 460
#extension GL_GOOGLE_include_directive : require
// The centre sample's instanced triangle id + 1, and its distance along the view's axis in metres.
#include "shading/shaders/material.glsl"
#include "shading/shaders/view.glsl"

layout(constant_id = 30) const bool kMasked = false;

layout(location = 0) out uvec2 out_id_depth;

void main() {
  uint triangle = draw.first_triangle + uint(gl_PrimitiveID);
  if (kMasked) {
    Triangle t = fetch_triangle(draw.stand, triangle);
    SurfacePoint p = texture_point(t, triangle_point(t, sample_position(gl_FragCoord)));
    if (base_color(p).a < material.alpha_cutoff) discard;
  }
  uint id = instances[draw.instance].first_triangle + triangle - instances[draw.instance].geometry_first_triangle;
  out_id_depth = uvec2(id + 1u, floatBitsToUint(1.0 / gl_FragCoord.w));
}
