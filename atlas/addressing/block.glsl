// Rectangles of one, two or three triangles (thesis figs. 3.3, 3.4): which texels a patch's corners lie in, and which point of
// the patch a texel shows. Sides are any whole numbers >= 2 of texels.
#ifndef TESSERA_ADDRESSING_BLOCK_GLSL
#define TESSERA_ADDRESSING_BLOCK_GLSL

#include "atlas/addressing/language.glsl"

// A masked patch's block is split in halves, left and right if it is wider than high, else upper and lower: colour lies in the
// first, coverage in the second. The last row or column of an odd side is then unused.
INLINE ivec2 block_color_size(ivec2 size, bool masked) {
  if (!masked) return size;
  return size.x > size.y ? ivec2(size.x / 2, size.y) : ivec2(size.x, size.y / 2);
}

// From a texel to its coverage.
INLINE ivec2 block_coverage_offset(ivec2 size) {
  return size.x > size.y ? ivec2(size.x / 2, 0) : ivec2(0, size.y / 2);
}

// A texel by the half that it lies in.
struct BlockTexel {
  ivec2 texel;
  bool coverage;
};

INLINE BlockTexel block_half(ivec2 texel, ivec2 size, bool masked) {
  BlockTexel at;
  ivec2 offset = block_coverage_offset(size);
  at.coverage = masked && texel.x >= offset.x && texel.y >= offset.y;
  at.texel = at.coverage ? texel - offset : texel;
  return at;
}

// Where in a unit square corner 0..2 of triangle `triangle` of a patch of `count` lies (scene::patch_corner).
INLINE vec2 block_corner(int count, int triangle, int corner) {
  if (count < 3) {
    vec2 at = vec2(corner == 1 ? 1.0f : 0.0f, corner == 2 ? 1.0f : 0.0f);
    return triangle == 0 ? at : 1.0f - at;
  }
  if (corner == 2) return vec2(0.5f, 1.0f);
  if (triangle == 0) return vec2(float(corner), 0.0f);
  return triangle == 1 ? vec2(0.0f, float(1 - corner)) : vec2(1.0f, float(corner));
}

// The texel of a corner, if the far corner lies in texel `extent` = sides - 1. So a bilinear fetch never leaves the block
// (half-texel inset); the tip of three triangles may lie half a texel off the middle.
INLINE vec2 block_corner_texel(vec2 corner, vec2 extent) { return floor(corner * extent + 0.5f); }

// A texel of the colour part along the patch's axes, which are swapped if transposed, and how far they reach. A side of one
// texel stands for the middle of its axis.
struct BlockPosition {
  vec2 at;
  vec2 extent;
};

INLINE BlockPosition block_position(ivec2 texel, ivec2 color_size, bool transposed) {
  BlockPosition p;
  p.at = vec2(color_size.x > 1 ? float(texel.x) : 0.5f, color_size.y > 1 ? float(texel.y) : 0.5f);
  p.extent = vec2(float(max(color_size.x - 1, 1)), float(max(color_size.y - 1, 1)));
  if (transposed) {
    p.at = vec2(p.at.y, p.at.x);
    p.extent = vec2(p.extent.y, p.extent.x);
  }
  return p;
}

// Which triangle holds position `at` along the patch's axes in texels, in a block with its tip at `tip_x`.
INLINE int block_triangle(int count, vec2 at, vec2 extent, float tip_x) {
  if (count == 1) return 0;
  if (count == 2) return at.x * extent.y + at.y * extent.x <= extent.x * extent.y ? 0 : 1;
  if (at.x * extent.y < at.y * tip_x) return 1;
  return (extent.x - at.x) * extent.y < at.y * (extent.x - tip_x) ? 2 : 0;
}

struct BlockPoint {
  int triangle;   // of the patch
  vec2 weights;   // of its second and third corner, 0..1
  vec2 ddx, ddy;  // how these change from texel to texel along the patch's axes
};

// Inverse of block_corner_texel(), extended over the whole block. `extent` > 0.
INLINE BlockPoint block_point(int count, vec2 at, vec2 extent) {
  if (count == 1) {  // the half that the triangle leaves unused repeats its long edge
    float excess = at.x / extent.x + at.y / extent.y - 1.0f;
    if (excess > 0.0f) at -= 0.5f * excess * extent;
  }
  BlockPoint p;
  p.triangle = block_triangle(count, at, extent, floor(0.5f * extent.x + 0.5f));
  vec2 a = block_corner_texel(block_corner(count, p.triangle, 0), extent);
  vec2 e1 = block_corner_texel(block_corner(count, p.triangle, 1), extent) - a;
  vec2 e2 = block_corner_texel(block_corner(count, p.triangle, 2), extent) - a;
  float det = e1.x * e2.y - e1.y * e2.x;
  float inverse = det != 0.0f ? 1.0f / det : 0.0f;  // two texels cannot hold three triangles
  vec2 d = at - a;
  p.weights = clamp(vec2(d.x * e2.y - d.y * e2.x, e1.x * d.y - e1.y * d.x) * inverse, 0.0f, 1.0f);
  p.ddx = vec2(e2.y, -e1.y) * inverse;
  p.ddy = vec2(-e2.x, e1.x) * inverse;
  return p;
}

#endif
