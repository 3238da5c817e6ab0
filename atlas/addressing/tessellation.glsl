// How many vertices, and so samples, the tessellator makes of a triangle (TSS section 3.1): equal spacing, levels 1..64.
#ifndef TESSERA_ADDRESSING_TESSELLATION_GLSL
#define TESSERA_ADDRESSING_TESSELLATION_GLSL

#include "atlas/addressing/language.glsl"

const int kMaxTessellationLevel = 64;
const int kMaxTessellationVertices = 3169;

// TSS eq. 1: all four levels at `level` <= 64. 0 for levels below 0, which stands for a ring that is not there.
INLINE int tessellation_vertices(int level) {
  if (level < 0) return 0;
  int rings = level / 2;
  return 3 * (rings + 1) * (rings + level % 2) + (level + 1) % 2;
}

// Of the edges that lie opposite corner 0, 1 and 2, and of the inside.
struct TessellationLevels {
  ivec3 outer;
  int inner;
};

INLINE TessellationLevels uniform_levels(int level) {
  TessellationLevels levels;
  levels.outer = ivec3(level);
  levels.inner = level;
  return levels;
}

// The smallest levels that make exactly `count` vertices, 3 <= count <= 3169, their outer levels as even as can be. Stands in
// for TSS-supp eqs. 2-6, which as printed give another count almost always. No outer level is 0: that would cull the triangle.
INLINE TessellationLevels tessellation_levels(int count) {
  TessellationLevels levels;
  levels.outer = ivec3(1);
  levels.inner = 1;
  if (count <= 3) return levels;
  // Eq. 1 is 3/4 (level + 1)^2, rounded up, so the level is the root of 4/3 (count - 1), rounded down. That is whole or at least
  // a third away; adding a sixth keeps rounding from mattering.
  levels.inner = max(int(sqrt(float(8 * count - 7) / 6.0f)), 2);
  // The rings inside the outer one are those of two levels less.
  int outer = count - tessellation_vertices(levels.inner - 2);
  int first = (outer + 2) / 3;
  int second = (outer - first + 1) / 2;
  levels.outer = ivec3(first, second, outer - first - second);
  return levels;
}

#endif
