// Reads: the depth buffer (level 0) or the level below. Writes: one level of the pyramid.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "pvs/shaders/visibility.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(push_constant) uniform Level {
  uvec2 from_size;  // texels
  uvec2 to_size;
  uint from_start;  // kNone = the depth buffer
  uint to_start;
};

void main() {
  uvec2 to = gl_GlobalInvocationID.xy;
  if (any(greaterThanEqual(to, to_size))) return;
  bool is_first = from_start == kNone;
  uint tile = is_first ? kPyramidTile : 2;
  uvec2 end = min((to + 1) * tile, from_size);
  float farthest = 1.0;
  for (uint y = to.y * tile; y < end.y; ++y) {
    for (uint x = to.x * tile; x < end.x; ++x) {
      farthest = min(farthest, is_first ? texelFetch(depth, ivec2(x, y), 0).r
                                        : pyramid[from_start + y * from_size.x + x]);
    }
  }
  pyramid[to_start + to.y * to_size.x + to.x] = farthest;
}
