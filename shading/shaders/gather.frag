#version 460
#extension GL_GOOGLE_include_directive : require
// The attachment encodes to sRGB.
#include "shading/shaders/gather.glsl"

layout(location = 0) flat in uint in_block;
layout(location = 0) out vec4 out_color;

void main() {
  Block block = blocks[in_block];
  uvec2 texel = uvec2(gl_FragCoord.xy) - uvec2(block.place & 0xffffu, block.place >> 16);
  out_color = vec4(block_texel(block, texel), 1.0);
}
