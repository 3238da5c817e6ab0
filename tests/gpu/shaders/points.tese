#version 460
// Appends where each point lies and whose it is, and marks its patch in the image.
layout(triangles, equal_spacing, point_mode) in;
layout(location = 0) patch in uint owner;
layout(push_constant) uniform Pass { uint outer, inner, capacity; } pass;
layout(std430, set = 0, binding = 0) buffer Points {
  uint count;
  vec4 points[];  // barycentric coordinates, patch
};
layout(set = 0, binding = 1, r32ui) uniform uimage2D marked;

void main() {
  uint i = atomicAdd(count, 1u);
  if (i < pass.capacity) points[i] = vec4(gl_TessCoord, float(owner));
  imageStore(marked, ivec2(owner % 128u, owner / 128u), uvec4(owner + 1u));
}
