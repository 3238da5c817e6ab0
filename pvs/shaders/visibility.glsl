// Buffers of the culling passes: set 2. Shared by cull, compact and pyramid; pvs/culling.cpp writes the same
// records.
#ifndef TESSERA_VISIBILITY_GLSL
#define TESSERA_VISIBILITY_GLSL
#include "scene/shaders/scene.glsl"

// A bucket is a list of meshlets that one pipeline state draws: pvs/buckets.h.
const uint kBuckets = 6;
const uint kGroupSize = 64;   // meshlets a workgroup
const uint kPyramidTile = 2;  // depth pixels along a side of a texel of pyramid level 0

struct DrawCommand {  // VkDrawIndexedIndirectCommand
  uint index_count, instance_count, first_index;
  int vertex_offset;
  uint first_instance;  // index in instanced_meshlets[]
};

layout(set = 2, binding = 0, std430) readonly buffer Buckets {
  uint instance_bucket[];
};
layout(set = 2, binding = 1, std430) buffer WasVisible {
  uint was_visible[];
};  // by instanced meshlet
layout(set = 2, binding = 2, std430) buffer Survivors {
  uint survivor[];
};  // its instance; kNone = culled
layout(set = 2, binding = 3, std430) buffer GroupCounts {
  uint group_counts[];
};  // [workgroup][bucket]
layout(set = 2, binding = 4, std430) buffer Draws {
  DrawCommand draws[];
};
layout(set = 2, binding = 5, std430) buffer Counts {
  uint draw_count[kBuckets];
  uint drawn_meshlets, drawn_triangles;
};
// Farthest depth (smallest, as depth is reversed) of each texel's square, level by level, each half as large,
// rounded up.
layout(set = 2, binding = 6, std430) buffer Pyramid {
  float pyramid[];
};
layout(set = 2, binding = 7) uniform sampler2D depth;
struct MeshletBounds {  // geometry space
  vec4 low, high;
};
layout(set = 2, binding = 8, std430) readonly buffer Bounds {
  MeshletBounds bounds[];
};  // by meshlet

uvec2 half_size(uvec2 size) {
  return (size + 1) / 2;
}

#endif
