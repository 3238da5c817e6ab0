// Provisioning phase (thesis algorithm 2 with the corrections of atlas/blocks/allocator.cpp), one thread a
// column width. Reads: what was requested and what the stacks hold, by level. Writes: the superblocks that each
// width draws, the slots that they serve, what is carried over.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "atlas/shaders/blocks.glsl"

layout(local_size_x = 16) in;

shared uint needs[16];  // superblocks a width

int missing(LevelState level) {
  return level.requested - level.stack_size;
}

// Superblocks beyond the one that is carried over. Space is counted in lines: one texel high, as wide as the
// column.
uint superblocks_needed(uint log_w) {
  int lines = (column_state[log_w].carry_offset - blocks_per_superblock(log_w, log_w)) * (1 << log_w);
  for (uint log_h = 1; log_h <= log_w; ++log_h) {
    lines += max(0, missing(level_state[level_index(log_w, log_h)])) * (1 << log_h);
  }
  int per_superblock = blocks_per_superblock(log_w, 0);
  return lines > 0 ? uint((lines + per_superblock - 1) / per_superblock) : 0;
}

// The i-th of the superblocks that a column allocates from.
uint superblock_at(ColumnState column, int i) {
  return i == 0 ? column.first : free_superblocks[column.free_count - uint(i)];
}

void share_out(uint log_w, uint drawn) {
  ColumnState column = column_state[log_w];
  int squares = blocks_per_superblock(log_w, log_w);
  int offset = column.carry_offset;
  int available = (int(drawn) + 1) * squares - offset;
  // From high to low, so that no block straddles two columns.
  for (uint log_h = log_w; log_h >= 1; --log_h) {
    uint index = level_index(log_w, log_h);
    int served = clamp(missing(level_state[index]), 0, available);
    level_state[index].slot_offset = offset;
    level_state[index].slot_count = served;
    offset += served;
    available -= served;
    if (log_h > 1) {
      offset *= 2;
      available *= 2;
    }
  }
  column.carried = superblock_at(column, int(drawn));
  // What is left beside the last square goes to the stacks.
  for (uint log_h = 1; log_h < log_w; ++log_h) {
    if (offset % 2 == 1) {
      uint index = level_index(log_w, log_h);
      uint top = level_state[index].stack_start + uint(level_state[index].stack_size++);
      stacks[top] = block_of(column.carried, offset % blocks_per_superblock(log_w, log_h));
    }
    offset = (offset + 1) / 2;
  }
  column.carry_offset = offset - int(drawn) * squares;
  column_state[log_w] = column;
}

// The assignment phase takes what the superblocks do not serve from the stacks.
void take_from_stacks(uint log_w) {
  for (uint log_h = 1; log_h <= log_w; ++log_h) {
    LevelState level = level_state[level_index(log_w, log_h)];
    level.stack_top = level.stack_size;
    level.stack_size -= min(level.stack_size, level.requested - level.slot_count);
    level.requested = 0;
    level_state[level_index(log_w, log_h)] = level;
  }
}

void main() {
  uint log_w = gl_LocalInvocationID.x;
  bool works = log_w >= 1 && log_w <= superblock_log;
  needs[log_w] = works ? superblocks_needed(log_w) : 0;
  uint free_count = free_superblock_count;
  barrier();
  // Widest first.
  uint wider = 0, all = 0;
  for (uint other = 15; other >= 1; --other) {
    if (other > log_w) wider += needs[other];
    all += needs[other];
  }
  if (works) {
    column_state[log_w].first = column_state[log_w].carried;
    column_state[log_w].free_count = free_count - min(free_count, wider);
    uint drawn = min(needs[log_w], column_state[log_w].free_count);
    for (uint i = 1; i <= drawn; ++i) superblocks[superblock_at(column_state[log_w], int(i))].in_use = 1;
    share_out(log_w, drawn);
    take_from_stacks(log_w);
  }
  if (log_w == 0) free_superblock_count = free_count - min(free_count, all);
}
