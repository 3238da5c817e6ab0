#version 460
// Multiplies every value by a factor. One thread a value.
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 0) buffer Values { uint values[]; };
layout(push_constant) uniform Push { uint factor; };

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i < values.length()) values[i] *= factor;
}
