#version 460
#extension GL_GOOGLE_include_directive : require
// Reads the scene's materials, writes them where the CPU can see them: MaterialGroups.
#include "scene/shaders/scene.glsl"

layout(local_size_x = 64) in;

layout(set = 1, binding = 1, std430) writeonly buffer Copies { MaterialRecord copies[]; };
layout(push_constant) uniform Pass { uint count; } pass;

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i < pass.count) copies[i] = materials[i];
}
