#version 460
// Every patch at the pushed levels.
layout(vertices = 1) out;
layout(location = 0) in uint patch_number[];
layout(location = 0) patch out uint owner;
layout(push_constant) uniform Pass { uint outer, inner, capacity; } pass;

void main() {
  owner = patch_number[0];
  for (int i = 0; i < 3; ++i) gl_TessLevelOuter[i] = float(pass.outer);
  gl_TessLevelInner[0] = float(pass.inner);
}
