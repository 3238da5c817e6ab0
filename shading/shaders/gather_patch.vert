#version 460
#extension GL_GOOGLE_include_directive : require
// Tessellation path: a vertex is an L, or a part of a half, with the levels that make a point for each of its samples.
#include "shading/shaders/gather.glsl"

layout(location = 0) out uint out_number;
layout(location = 1) out vec4 out_levels;

TessellationLevels block_levels(Block block) {
  if (has_flag(block, kBlockL)) return uniform_levels(l_level(block));
  int samples = staircase_samples(half_stairs(block));
  return tessellation_levels(min(oversampling_part(samples), samples - int(block.first_sample)));
}

void main() {
  TessellationLevels levels = block_levels(blocks[gl_VertexIndex]);
  out_number = uint(gl_VertexIndex);
  out_levels = vec4(levels.outer, levels.inner);
}
