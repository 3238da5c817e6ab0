// Oversampling (TSS section 3.3): a number for each vertex of the tessellator, and the block of samples that covers a
// right-angled triangle, in rows that grow shorter. Both are re-derived: as printed the numbers of no level are distinct.
#ifndef TESSERA_ADDRESSING_OVERSAMPLING_GLSL
#define TESSERA_ADDRESSING_OVERSAMPLING_GLSL

#include "atlas/addressing/tessellation.glsl"

// The number, 0..count - 1, of a vertex of the tessellator at tessellation_levels(count): ring by ring from the middle, side by
// side in each (TSS eqs. 5-8, TSS-supp eqs. 8-18). Coordinates are rounded, like those of l_texels().
INLINE int oversampling_id(vec3 lambda, TessellationLevels levels) {
  float inner = float(levels.inner);
  float least = min(lambda.x, min(lambda.y, lambda.z));
  int ring = int(floor(1.5f * inner * least + 0.5f));  // from the outside
  if (ring == 0) {
    const float kZero = 1.0f / 256.0f;  // between an edge and what lies next to it
    int side = lambda.x < kZero && lambda.z > kZero ? 0 : lambda.y < kZero && lambda.x > kZero ? 1 : 2;
    int along = int(floor(lambda[(side + 1) % 3] * float(levels.outer[side]) + 0.5f));
    int before = (side > 0 ? levels.outer.x : 0) + (side > 1 ? levels.outer.y : 0);
    return tessellation_vertices(levels.inner - 2) + before + along;
  }
  int length = levels.inner - 2 * ring;  // of the ring's sides
  if (length == 0) return 0;
  ivec3 steps = ivec3(floor(inner * lambda - float(ring) * (2.0f / 3.0f) + 0.5f));
  int side = steps.x == 0 && steps.z != 0 ? 0 : steps.y == 0 && steps.x != 0 ? 1 : 2;
  return tessellation_vertices(length - 2) + side * length + steps[(side + 1) % 3];
}

// More samples than a triangle can have are those of several triangles: so many of each but the last, which has fewer, though
// never under 3 (of up to 200,000).
INLINE int oversampling_part(int samples) {
  int parts = (samples + kMaxTessellationVertices - 1) / kMaxTessellationVertices;
  return (samples + parts - 1) / parts;
}

// The block of samples of the triangle (0, 0), (size.x, 0), (0, size.y), in steps between samples; 1 <= size.x <= size.y,
// size.x <= 128, size.y <= 1024: sizes up to which the functions below are checked. Every bilinear footprint of the triangle
// lies in it. Row 0 has size.x + 1 samples, each stretch of staircase_stretch() rows below it one sample less than the one above.
INLINE int staircase_stretch(ivec2 size) { return (size.y + size.x - 1) / size.x; }  // TSS eq. 9

INLINE int staircase_row(int y, ivec2 size) {
  return y == 0 ? size.x + 1 : size.x + 1 - (y - 1) / staircase_stretch(size);
}

INLINE bool staircase_contains(ivec2 at, ivec2 size) {
  return at.x >= 0 && at.y >= 0 && at.y <= size.y && at.x < staircase_row(at.y, size);
}

// Samples in the first `stretches` stretches, without row 0.
INLINE int staircase_before(int stretches, ivec2 size) {
  return staircase_stretch(size) * (stretches * (size.x + 1) - stretches * (stretches - 1) / 2);
}

// TSS eq. 10, which as printed holds only where the stretches are all full.
INLINE int staircase_samples(ivec2 size) {
  int stretch = staircase_stretch(size);
  int full = size.y / stretch;
  int rest = size.y - full * stretch;
  return size.x + 1 + staircase_before(full, size) + rest * (size.x + 1 - full);
}

// Sample `id` < staircase_samples(), row by row (TSS eq. 11; TSS-supp eqs. 20-23).
INLINE ivec2 staircase_position(int id, ivec2 size) {
  if (id <= size.x) return ivec2(id, 0);
  int below = id - (size.x + 1);
  int stretch = staircase_stretch(size);
  // Where rounding takes the first sample of a stretch for the one after the last of the stretch above, that is the same place.
  float a = float(2 * size.x + 3);
  int stretches = int(0.5f * (a - sqrt(a * a - 8.0f * float(below) / float(stretch))));
  int in_stretch = below - staircase_before(stretches, size);
  int length = size.x + 1 - stretches;
  return ivec2(in_stretch % length, in_stretch / length + stretch * stretches + 1);
}

#endif
