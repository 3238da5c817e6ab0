// Reads: what cull.comp found, and the counts of its workgroups.
// Writes: the draw commands of each bucket, in the order of the meshlets (not of the threads, so that results
// repeat). Meshlets of one instance that follow each other share a draw.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "pvs/shaders/visibility.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Compact {
  uint first_draw[kBuckets];  // where each bucket's commands begin
  uint meshlet_count;
};

shared uint before[kBuckets];  // draws of earlier workgroups
shared uint lane_instance[kGroupSize];
shared uint lane_bucket[kGroupSize];  // of the draw that begins here; kNone = none does
shared uint group_meshlets, group_triangles;

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
  uint triangles = 0, end = lane;
  for (; end < kGroupSize && lane_instance[end] == lane_instance[lane]; ++end) {
    triangles += meshlets[instanced_meshlets[index + end - lane].y].triangle_count;
  }
  uint first_triangle = meshlets[instanced_meshlets[index].y].first_triangle;
  draws[first_draw[bucket] + before[bucket] + rank] =
      DrawCommand(3 * triangles, 1, 3 * first_triangle, 0, index);
  atomicAdd(group_meshlets, end - lane);
  atomicAdd(group_triangles, triangles);
}

void main() {
  uint lane = gl_LocalInvocationID.x;
  uint index = gl_GlobalInvocationID.x;
  if (lane < kBuckets) before[lane] = 0;
  if (lane == 0) group_meshlets = group_triangles = 0;
  lane_instance[lane] = index < meshlet_count ? survivor[index] : kNone;
  barrier();
  bool begins = lane_instance[lane] != kNone && (lane == 0 || lane_instance[lane - 1] != lane_instance[lane]);
  uint bucket = begins ? instance_bucket[lane_instance[lane]] : kNone;
  lane_bucket[lane] = bucket;
  count_earlier_groups(lane);
  barrier();
  if (begins) write_draw(index, bucket, lane);
  barrier();
  if (lane == 0) {
    atomicAdd(drawn_meshlets, group_meshlets);
    atomicAdd(drawn_triangles, group_triangles);
  }
  if (gl_WorkGroupID.x + 1 == gl_NumWorkGroups.x && lane < kBuckets) {
    draw_count[lane] = before[lane] + group_counts[gl_WorkGroupID.x * kBuckets + lane];
  }
}
