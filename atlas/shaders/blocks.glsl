// Buffers of the block allocator's passes: set 0. atlas/blocks/gpu_allocator.cpp has the same records.
#ifndef TESSERA_BLOCKS_GLSL
#define TESSERA_BLOCKS_GLSL

const uint kGroupSize = 256;  // requests a workgroup
const uint kLevels = 45;      // levels with log_h <= log_w <= 8, row by row; those without height stay unused
const uint kWidths = 9;       // binary logarithms of a column's width; 0 stays unused
const uint kKeys = 2 * kLevels;  // what a request may count as: a freed level, an allocated level
const uint kNoBlock = 0xffffffffu;

// A block is superblock << (2 * superblock_log - 2) | index. A level is log_w | log_h << 4; 0 = none.
struct Request {
  uint old_block;
  uint levels;  // the freed one | the allocated one << 8
};
struct LevelState {
  uint stack_start;  // in stacks[]
  int stack_size;    // free blocks
  int requested;
  int slot_offset, slot_count;  // requests below slot_count are served from the column's superblocks
  int stack_top;                // free blocks before the assignment phase takes some
};
struct ColumnState {
  int carry_offset;        // square blocks taken from the superblock that is carried over
  uint carried;            // that superblock
  uint first, free_count;  // of this frame: superblock 0 is `first`, i > 0 is free_superblocks[free_count - i]
};
struct Superblock {
  uint used_texels;
  uint in_use;  // not in free_superblocks[]
};

layout(set = 0, binding = 0, std430) readonly buffer Requests {
  Request requests[];
};
layout(set = 0, binding = 1, std430) buffer Blocks {
  uint blocks[];
};  // a request
layout(set = 0, binding = 2, std430) buffer Slots {
  int slots[];
};  // a request: how many before it allocate its level
layout(set = 0, binding = 3, std430) buffer GroupCounts {
  int group_counts[];
};  // [key][workgroup]: requests; then how many there are before the workgroup
layout(set = 0, binding = 4, std430) buffer State {
  LevelState level_state[kLevels];
  ColumnState column_state[kWidths];
  uint free_superblock_count;
  uint recycled;  // superblocks
};
layout(set = 0, binding = 5, std430) buffer Stacks {
  uint stacks[];
};  // by level
layout(set = 0, binding = 6, std430) buffer FreeSuperblocks {
  uint free_superblocks[];
};  // a stack, falling
layout(set = 0, binding = 7, std430) buffer Superblocks {
  Superblock superblocks[];
};

layout(push_constant) uniform Push {
  uint request_count;
  uint group_count;
  uint superblock_log;
  uint superblock_count;
};

// Beyond the last: one that asks for nothing.
Request request_at(uint index) {
  if (index < request_count) return requests[index];
  return Request(kNoBlock, 0);
}

uint log_w_of(uint level) {
  return level & 15u;
}
uint log_h_of(uint level) {
  return level >> 4;
}
uint level_index(uint log_w, uint log_h) {
  return log_w * (log_w + 1) / 2 + log_h;
}
uint level_index(uint level) {
  return level_index(log_w_of(level), log_h_of(level));
}
uint texel_count(uint level) {
  return 1u << (log_w_of(level) + log_h_of(level));
}
uint freed_level(Request r) {
  return r.levels & 255u;
}
uint allocated_level(Request r) {
  return r.levels >> 8;
}
uint free_key(Request r) {
  return level_index(freed_level(r));
}
uint allocate_key(Request r) {
  return kLevels + level_index(allocated_level(r));
}

int blocks_per_superblock(uint log_w, uint log_h) {
  return 1 << (2 * superblock_log - log_w - log_h);
}
uint block_of(uint superblock, int index) {
  return (superblock << (2 * superblock_log - 2)) | uint(index);
}
uint superblock_of(uint block) {
  return block >> (2 * superblock_log - 2);
}
bool is_empty(Superblock s) {
  return s.in_use != 0 && s.used_texels == 0;
}

#endif
