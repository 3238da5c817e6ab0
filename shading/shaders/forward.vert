#version 460
#extension GL_GOOGLE_include_directive : require
// Draws ranges of one instance's triangles. One vertex shader for all forward passes,
// so that their depths agree to the bit.
#include "shading/shaders/view.glsl"

void main() {
  gl_Position = view.clip_from_relative * vec4(to_relative(draw.instance, vertex_position(uint(gl_VertexIndex))), 1.0);
}
