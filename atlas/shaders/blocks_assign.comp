// Assignment phase (thesis algorithm 3). Reads: requests, slots, what provisioning prepared. Writes: a block
// for each request; kNoBlock if it allocates none or memory ran out.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "atlas/shaders/blocks.glsl"

layout(local_size_x = 256) in;

uint assigned_block(uint level, int slot) {
  LevelState state = level_state[level_index(level)];
  if (slot < state.slot_count) {
    ColumnState column = column_state[log_w_of(level)];
    int per_superblock = blocks_per_superblock(log_w_of(level), log_h_of(level));
    int at = slot + state.slot_offset;
    int i = at / per_superblock;
    uint superblock = i == 0 ? column.first : free_superblocks[column.free_count - uint(i)];
    return block_of(superblock, at % per_superblock);
  }
  int top = state.stack_top - 1 - (slot - state.slot_count);
  return top >= 0 ? stacks[state.stack_start + uint(top)] : kNoBlock;
}

void main() {
  uint index = gl_GlobalInvocationID.x;
  if (index >= request_count) return;
  uint level = allocated_level(requests[index]);
  uint block = level != 0 ? assigned_block(level, slots[index]) : kNoBlock;
  blocks[index] = block;
  if (block != kNoBlock) atomicAdd(superblocks[superblock_of(block)].used_texels, texel_count(level));
}
