// Request phase, first part. Reads: requests. Writes: how many of each key a workgroup has.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "atlas/shaders/blocks_rank.glsl"

void main() {
  mark_request();
  for (uint key = gl_LocalInvocationID.x; key < kKeys; key += kGroupSize) {
    group_counts[key * group_count + gl_WorkGroupID.x] = count_marked(key);
  }
}
