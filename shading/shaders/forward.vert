#version 460
#extension GL_GOOGLE_include_directive : require
// Draws ranges of one instance's triangles. One vertex shader for all forward passes,
// so that their depths agree to the bit.
#include "shading/shaders/view.glsl"

void main() {
  vec4 clip = view.clip_from_relative * vec4(stand_position(draw.stand, vertex_position(uint(gl_VertexIndex))), 1.0);
  // Brings the sample to the pixel's centre.
  clip.xy += vec2(0.5 - draw.sample_at.x, draw.sample_at.y - 0.5) * view.pixel_size.xy * clip.w;
  gl_Position = clip;
}
