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
    Triangle t = fetch_triangle(draw.instance, triangle);
    if (is_cut_away(texture_point(draw.material, t, triangle_point(t, gl_FragCoord.xy)))) discard;
  }
  uint id = instances[draw.instance].first_triangle + triangle - instances[draw.instance].geometry_first_triangle;
  out_id_depth = uvec2(id + 1u, floatBitsToUint(1.0 / gl_FragCoord.w));
}
