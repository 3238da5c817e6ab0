// Request phase, last part (thesis algorithm 1). Reads: requests, how many come before each workgroup. Writes:
// freed blocks to their stacks, slots of those that allocate.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "atlas/shaders/blocks_rank.glsl"

void main() {
  Request r = mark_request();
  uint freed = freed_level(r);
  if (freed != 0) {
    stacks[level_state[level_index(freed)].stack_start + rank(free_key(r))] = r.old_block;
    atomicAdd(superblocks[superblock_of(r.old_block)].used_texels, 0u - texel_count(freed));
  }
  if (allocated_level(r) != 0) slots[gl_GlobalInvocationID.x] = rank(allocate_key(r));
}
