// Recycling, first part, one workgroup. Reads: superblocks. Writes: how many are in use and empty.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "atlas/shaders/blocks.glsl"

layout(local_size_x = 256) in;

shared uint found;

void main() {
  uint lane = gl_LocalInvocationID.x;
  if (lane == 0) found = 0;
  barrier();
  uint count = 0;
  for (uint i = lane; i < superblock_count; i += kGroupSize) count += is_empty(superblocks[i]) ? 1 : 0;
  atomicAdd(found, count);
  barrier();
  if (lane == 0) recycled = found;
}
