#version 460
#extension GL_GOOGLE_include_directive : require
// TSS section 3: one invocation a sample, which knows its place by where it lies in the tessellated triangle.
#include "shading/shaders/gather.glsl"
#include "shading/shaders/tessellated.glsl"

layout(triangles, equal_spacing, point_mode) in;
layout(location = 0) patch in uint in_block;

layout(set = 3, binding = 4, rgba8) uniform writeonly image2D atlas;

void main() {
  Block block = blocks[in_block];
  ivec2 texel, copy;
  if (has_flag(block, kBlockL)) {
    LTexels at = l_texels(gl_TessCoord, l_level(block));
    texel = l_pair_texel(at.texel, has_flag(block, kBlockTurned), l_level(block));
    copy = l_pair_texel(at.copy, has_flag(block, kBlockTurned), l_level(block));
  } else {
    texel = block_sample(block, block.first_sample + uint(oversampling_id(gl_TessCoord, tessellated_levels())));
    copy = texel;
  }
  vec4 color = vec4(srgb_encode_color(block_texel(block, texel)), 1.0);
  ivec2 place = ivec2(block.place & 0xffffu, block.place >> 16);
  imageStore(atlas, place + texel, color);
  if (copy != texel) imageStore(atlas, place + copy, color);
}
