#version 460
#extension GL_GOOGLE_include_directive : require
// One invocation a sample, one dispatch a material, so that textures are uniform and a material's loads cheap.
#include "shading/shaders/gather.glsl"

layout(local_size_x = 64) in;

layout(set = 3, binding = 2, std430) readonly buffer Starts { uint starts[]; };  // first block of each chunk
layout(set = 3, binding = 3, std430) writeonly buffer Colors { uint colors[]; };
layout(set = 3, binding = 4, rgba8) uniform writeonly image2D atlas;

void main() {
  uint chunk = pass.first_chunk + gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
  if (chunk >= pass.end_chunk) return;
  uint s = chunk * 64u + gl_LocalInvocationID.x;
  uint b = starts[chunk];
  while (s >= blocks[b + 1u].first_sample) ++b;  // the last block is followed by one that never starts
  Block block = blocks[b];
  uint i = s - block.first_sample;
  if (i >= block_samples(block)) return;  // padding between materials
  ivec2 texel = block_sample(block, i);
  vec4 color = vec4(srgb_encode_color(block_texel(block, texel)), 1.0);
  if ((block.shape & kBlockColor) != 0u)
    colors[block.place] = packUnorm4x8(vec4(color.rgb, 0.0));
  else
    imageStore(atlas, ivec2(block.place & 0xffffu, block.place >> 16) + texel, color);
}
