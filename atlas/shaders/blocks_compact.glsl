// Keeps some of the items that a workgroup walks through, in their order. In place: a stretch of items is read
// before any of it is written, and never written further on than it was read.
#ifndef TESSERA_BLOCKS_COMPACT_GLSL
#define TESSERA_BLOCKS_COMPACT_GLSL
#include "atlas/shaders/blocks.glsl"

layout(local_size_x = 256) in;

const uint kWords = kGroupSize / 32;
shared uint kept[kWords];  // bits of the lanes

// How many lanes before this one keep their item; `total`: how many in the workgroup do. Begins and ends with a
// barrier.
uint rank_of_kept(bool keeps, out uint total) {
  uint lane = gl_LocalInvocationID.x;
  barrier();
  if (lane < kWords) kept[lane] = 0;
  barrier();
  if (keeps) atomicOr(kept[lane / 32], 1u << (lane % 32));
  barrier();
  uint before = bitCount(kept[lane / 32] & ((1u << (lane % 32)) - 1));
  total = 0;
  for (uint word = 0; word < kWords; ++word) {
    if (word < lane / 32) before += bitCount(kept[word]);
    total += bitCount(kept[word]);
  }
  return before;
}

#endif
