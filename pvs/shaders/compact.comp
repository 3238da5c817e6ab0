// Reads: the buckets that cull.comp chose and the counts of its workgroups.
// Writes: the draw commands of each bucket, in the order of the meshlets (not of the threads, so that results repeat).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "pvs/shaders/visibility.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Compact {
  uint first_draw[kBuckets];  // where each bucket's commands begin
  uint meshlet_count;
};

shared uint before[kBuckets];  // drawn by earlier workgroups
shared uint lane_bucket[kGroupSize];
shared uint group_triangles;

void count_earlier_groups(uint lane) {
  uint sum[kBuckets];
  for (uint b = 0; b < kBuckets; ++b) sum[b] = 0;
  for (uint group = lane; group < gl_WorkGroupID.x; group += kGroupSize) {
    for (uint b = 0; b < kBuckets; ++b) sum[b] += group_counts[group * kBuckets + b];
  }
  for (uint b = 0; b < kBuckets; ++b) atomicAdd(before[b], sum[b]);
}

void write_draw(uint index, uint bucket, uint lane) {
  uint rank = 0;
  for (uint other = 0; other < lane; ++other) rank += lane_bucket[other] == bucket ? 1 : 0;
  MeshletRecord meshlet = meshlets[instanced_meshlets[index].y];
  draws[first_draw[bucket] + before[bucket] + rank] =
      DrawCommand(3 * meshlet.triangle_count, 1, 3 * meshlet.first_triangle, 0, index);
  atomicAdd(group_triangles, meshlet.triangle_count);
}

void main() {
  uint lane = gl_LocalInvocationID.x;
  uint index = gl_GlobalInvocationID.x;
  if (lane < kBuckets) before[lane] = 0;
  if (lane == 0) group_triangles = 0;
  uint bucket = index < meshlet_count ? survivor_bucket[index] : kNone;
  lane_bucket[lane] = bucket;
  barrier();
  count_earlier_groups(lane);
  barrier();
  if (bucket != kNone) write_draw(index, bucket, lane);
  barrier();
  if (lane == 0) atomicAdd(drawn_triangles, group_triangles);
  if (gl_WorkGroupID.x + 1 == gl_NumWorkGroups.x && lane < kBuckets) {
    draw_count[lane] = before[lane] + group_counts[gl_WorkGroupID.x * kBuckets + lane];
  }
}
