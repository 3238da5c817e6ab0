// Request phase, last part (thesis algorithm 1). Reads: requests, how many come before each workgroup. Writes:
// freed blocks to their stacks, slots of those that allocate. Ranks within a workgroup come from one bit a
// request: they repeat from run to run, where atomic counters would number requests in the order of the threads.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "atlas/shaders/blocks.glsl"

layout(local_size_x = 256) in;

const uint kWords = kGroupSize / 32;
shared uint marks[kKeys * kWords];  // requests by key; cleared where a request needs it

void clear(uint key) {
  for (uint word = 0; word < kWords; ++word) marks[key * kWords + word] = 0;
}

void mark(uint key) {
  uint lane = gl_LocalInvocationID.x;
  atomicOr(marks[key * kWords + lane / 32], 1u << (lane % 32));
}

// How many requests before this one count as its key, all workgroups together.
int rank(uint key) {
  uint lane = gl_LocalInvocationID.x;
  int count = group_counts[key * group_count + gl_WorkGroupID.x];
  for (uint word = 0; word < lane / 32; ++word) count += bitCount(marks[key * kWords + word]);
  return count + bitCount(marks[key * kWords + lane / 32] & ((1u << (lane % 32)) - 1));
}

void main() {
  uint index = gl_GlobalInvocationID.x;
  Request r = request_at(index);
  bool frees = freed_level(r) != 0, allocates = allocated_level(r) != 0;
  if (frees) clear(free_key(r));
  if (allocates) clear(allocate_key(r));
  barrier();
  if (frees) mark(free_key(r));
  if (allocates) mark(allocate_key(r));
  barrier();
  if (frees) {
    uint level = freed_level(r);
    stacks[level_state[level_index(level)].stack_start + rank(free_key(r))] = r.old_block;
    atomicAdd(superblocks[superblock_of(r.old_block)].used_texels, 0u - texel_count(level));
  }
  if (allocates) slots[index] = rank(allocate_key(r));
}
