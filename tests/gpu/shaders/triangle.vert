#version 460
// Pulls clip-space positions; passes the instance number on.
layout(std430, set = 0, binding = 0) readonly buffer Positions { vec4 positions[]; };
layout(location = 0) flat out uint instance;

void main() {
  gl_Position = positions[gl_VertexIndex];
  instance = gl_InstanceIndex;
}
