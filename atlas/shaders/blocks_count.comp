// Request phase, first part. Reads: requests. Writes: how many of each key a workgroup has.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "atlas/shaders/blocks.glsl"

layout(local_size_x = 256) in;

shared uint counts[kKeys];

void main() {
  uint lane = gl_LocalInvocationID.x;
  uint index = gl_GlobalInvocationID.x;
  if (lane < kKeys) counts[lane] = 0;
  barrier();
  Request r = request_at(index);
  if (freed_level(r) != 0) atomicAdd(counts[free_key(r)], 1);
  if (allocated_level(r) != 0) atomicAdd(counts[allocate_key(r)], 1);
  barrier();
  if (lane < kKeys) group_counts[lane * group_count + gl_WorkGroupID.x] = int(counts[lane]);
}
