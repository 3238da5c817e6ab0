// Request phase, second part, one workgroup a key. Reads: the workgroups' counts. Writes: their prefix sums in
// place, beginning with what is on the stack for keys that free; the stack's new size, the number requested.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "atlas/shaders/blocks.glsl"

layout(local_size_x = 256) in;

shared int sums[kGroupSize];

// Of the lanes up to this one.
int inclusive_sum(int value) {
  uint lane = gl_LocalInvocationID.x;
  sums[lane] = value;
  for (uint step = 1; step < kGroupSize; step *= 2) {
    barrier();
    int below = lane >= step ? sums[lane - step] : 0;
    barrier();
    sums[lane] += below;
  }
  barrier();
  return sums[lane];
}

void main() {
  uint key = gl_WorkGroupID.x;
  uint lane = gl_LocalInvocationID.x;
  bool frees = key < kLevels;
  uint level = frees ? key : key - kLevels;

  // Each lane sums up a stretch of workgroups.
  uint stretch = (group_count + kGroupSize - 1) / kGroupSize;
  uint begin = key * group_count + min(lane * stretch, group_count);
  uint end = key * group_count + min((lane + 1) * stretch, group_count);
  int sum = 0;
  for (uint i = begin; i < end; ++i) sum += group_counts[i];

  int start = frees ? level_state[level].stack_size : 0;
  int after = start + inclusive_sum(sum);
  int before = after - sum;
  for (uint i = begin; i < end; ++i) {
    int count = group_counts[i];
    group_counts[i] = before;
    before += count;
  }
  if (lane + 1 < kGroupSize) return;
  if (frees) {
    level_state[level].stack_size = after;
  } else {
    level_state[level].requested = after;
  }
}
