// Reads the atlas (sRGB-encoded values, through an rgba8 view); writes I420 planes, one after another, four samples a word.
// The same integers as codec/yuv.cpp, so both give the same bytes. One invocation: 8 x 2 texels.
#version 460

layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0, rgba8) uniform readonly image2D atlas;
layout(set = 0, binding = 1) writeonly buffer Planes { uint words[]; };

layout(push_constant) uniform Push { uint width, height; } size;

const ivec3 kLuma = ivec3(11966, 40254, 4064);
const ivec3 kBlue = ivec3(-6596, -22189, 28785);
const ivec3 kRed = ivec3(28785, -26145, -2640);

int weighted(ivec3 weights, ivec3 rgb) {
  const ivec3 p = weights * rgb;
  return p.x + p.y + p.z;
}
uint luma(ivec3 rgb) { return uint(16 + ((weighted(kLuma, rgb) + (1 << 15)) >> 16)); }
// `sum4`: over four texels.
uint chroma(ivec3 weights, ivec3 sum4) { return uint(128 + ((weighted(weights, sum4) + (1 << 17)) >> 18)); }

ivec3 texel(uvec2 at) { return ivec3(imageLoad(atlas, ivec2(at)).rgb * 255.0 + 0.5); }

void main() {
  const uvec2 corner = gl_GlobalInvocationID.xy * uvec2(8, 2);
  if (corner.x >= size.width || corner.y >= size.height) return;

  uint y[4] = uint[4](0, 0, 0, 0);  // two words of the upper row, two of the lower
  uint u = 0, v = 0;
  for (uint column = 0; column < 4; ++column) {
    ivec3 sum = ivec3(0);
    for (uint row = 0; row < 2; ++row) {
      for (uint side = 0; side < 2; ++side) {
        const uint x = 2 * column + side;
        const ivec3 rgb = texel(corner + uvec2(x, row));
        sum += rgb;
        y[2 * row + x / 4] |= luma(rgb) << (8 * (x % 4));
      }
    }
    u |= chroma(kBlue, sum) << (8 * column);
    v |= chroma(kRed, sum) << (8 * column);
  }

  const uint luma_at = (corner.y * size.width + corner.x) / 4;
  words[luma_at] = y[0];
  words[luma_at + 1] = y[1];
  words[luma_at + size.width / 4] = y[2];
  words[luma_at + size.width / 4 + 1] = y[3];
  const uint chroma_at = size.width * size.height / 4 + (corner.y / 2 * (size.width / 2) + corner.x / 2) / 4;
  words[chroma_at] = u;
  words[chroma_at + size.width * size.height / 16] = v;
}
