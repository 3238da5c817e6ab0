// Recycling, last part, one workgroup. Reads and writes: superblocks; those not in use, or empty, are the free
// ones, the lowest drawn first.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "atlas/shaders/blocks_compact.glsl"

void main() {
  if (recycled == 0) return;
  uint lane = gl_LocalInvocationID.x;
  uint found = 0;
  for (uint begin = 0; begin < superblock_count; begin += kGroupSize) {
    bool exists = begin + lane < superblock_count;
    uint superblock = superblock_count - 1 - (begin + lane);
    bool is_free = exists && superblocks[superblock].used_texels == 0;
    uint total;
    uint before = rank_of_kept(is_free, total);
    if (is_free) {
      superblocks[superblock].in_use = 0;
      free_superblocks[found + before] = superblock;
    }
    found += total;
  }
  if (lane == 0) free_superblock_count = found;
}
