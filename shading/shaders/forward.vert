#version 460
#extension GL_GOOGLE_include_directive : require
// Draws ranges of one instance's triangles; first_instance is the instance. One vertex shader for all forward passes,
// so that their depths agree to the bit.
#include "shading/shaders/view.glsl"

layout(location = 0) flat out uint out_instance;

void main() {
  uint instance = uint(gl_InstanceIndex);
  out_instance = instance;
  gl_Position = view.clip_from_relative * vec4(to_relative(instance, vertex_position(uint(gl_VertexIndex))), 1.0);
}
