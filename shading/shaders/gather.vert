#version 460
#extension GL_GOOGLE_include_directive : require
// A block's rectangle as two triangles; first_instance is the first of a material's blocks.
#include "shading/shaders/gather.glsl"

layout(location = 0) flat out uint out_block;

void main() {
  const uint kCorners[6] = uint[](0u, 1u, 2u, 2u, 1u, 3u);
  uint corner = kCorners[gl_VertexIndex];
  Block block = blocks[gl_InstanceIndex];
  uvec2 size = block_rectangle(block);
  uvec2 texel = uvec2(block.place & 0xffffu, block.place >> 16) + uvec2(corner & 1u, corner >> 1) * size;
  vec2 unit = vec2(texel) / vec2(pass.atlas_size);
  out_block = uint(gl_InstanceIndex);
  gl_Position = vec4(2.0 * unit.x - 1.0, 1.0 - 2.0 * unit.y, 0.0, 1.0);
}
