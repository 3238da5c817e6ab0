#version 460
#extension GL_GOOGLE_include_directive : require
// The attachment encodes to sRGB.
#include "shading/shaders/gather.glsl"

layout(location = 0) flat in uint in_block;
layout(location = 0) out vec4 out_color;

void main() {
  Block block = blocks[in_block];
  ivec2 texel = ivec2(gl_FragCoord.xy) - ivec2(block.place & 0xffffu, block.place >> 16);
  if (!block_has(block, texel)) discard;
  out_color = vec4(block_texel(block, texel), 1.0);
}
