// Which requests of a workgroup count as a key: one bit a request. Ranks by counting bits repeat from run to
// run, where atomic counters would number requests in the order of the threads.
#ifndef TESSERA_BLOCKS_RANK_GLSL
#define TESSERA_BLOCKS_RANK_GLSL
#include "atlas/shaders/blocks.glsl"

layout(local_size_x = 256) in;

const uint kWords = kGroupSize / 32;
shared uint marks[kKeys * kWords];

uint free_key(Request r) {
  return level_index(freed_level(r));
}
uint allocate_key(Request r) {
  return kLevels + level_index(allocated_level(r));
}

void mark(uint key) {
  uint lane = gl_LocalInvocationID.x;
  atomicOr(marks[key * kWords + lane / 32], 1u << (lane % 32));
}

// This lane's request; without one, a request that asks for nothing. Ends with a barrier.
Request mark_request() {
  uint lane = gl_LocalInvocationID.x;
  uint index = gl_GlobalInvocationID.x;
  for (uint i = lane; i < kKeys * kWords; i += kGroupSize) marks[i] = 0;
  barrier();
  Request r = Request(kNoBlock, 0);
  if (index < request_count) r = requests[index];
  if (freed_level(r) != 0) mark(free_key(r));
  if (allocated_level(r) != 0) mark(allocate_key(r));
  barrier();
  return r;
}

int count_marked(uint key) {
  int count = 0;
  for (uint word = 0; word < kWords; ++word) count += bitCount(marks[key * kWords + word]);
  return count;
}

// How many requests before this one count as its key, all workgroups together.
int rank(uint key) {
  uint lane = gl_LocalInvocationID.x;
  int count = group_counts[key * group_count + gl_WorkGroupID.x];
  for (uint word = 0; word < lane / 32; ++word) count += bitCount(marks[key * kWords + word]);
  return count + bitCount(marks[key * kWords + lane / 32] & ((1u << (lane % 32)) - 1));
}

#endif
