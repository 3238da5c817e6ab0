// Recycling, second part, one workgroup a level. Reads: superblocks. Writes: the stack without the blocks of
// empty superblocks; a column whose carried superblock is empty forgets its rest.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "atlas/shaders/blocks_compact.glsl"

void forget_empty_carry(uint log_w) {
  uint carried = column_state[log_w].carried;
  if (carried < superblock_count && is_empty(superblocks[carried])) {
    column_state[log_w].carry_offset = blocks_per_superblock(log_w, log_w);
  }
}

void main() {
  if (recycled == 0) return;
  uint lane = gl_LocalInvocationID.x;
  uint level = gl_WorkGroupID.x;
  if (level == 0 && lane >= 1 && lane <= superblock_log) forget_empty_carry(lane);

  uint start = level_state[level].stack_start;
  uint size = uint(level_state[level].stack_size);
  uint left = 0;
  for (uint begin = 0; begin < size; begin += kGroupSize) {
    bool exists = begin + lane < size;
    uint block = exists ? stacks[start + begin + lane] : kNoBlock;
    bool keeps = exists && !is_empty(superblocks[superblock_of(block)]);
    uint total;
    uint before = rank_of_kept(keeps, total);
    if (keeps) stacks[start + left + before] = block;
    left += total;
  }
  barrier();
  if (lane == 0) level_state[level].stack_size = int(left);
}
