// L-packing (TSS section 3.2): the samples of a triangle at tessellation level 1..64, folded open into an L. Barycentrics
// are those of the even grid (perspective.glsl); their largest names the tip that a sample belongs to.
#ifndef TESSERA_ADDRESSING_L_PACKING_GLSL
#define TESSERA_ADDRESSING_L_PACKING_GLSL

#include "atlas/addressing/language.glsl"

// The corners by their barycentric coordinate. Equal ones are ordered too: the three are always different.
struct Tips {
  int most;
  int middle;
  int least;
};

INLINE Tips sorted_tips(vec3 lambda) {
  Tips tips;
  tips.most = lambda.x >= lambda.y ? (lambda.x >= lambda.z ? 0 : 2) : (lambda.y >= lambda.z ? 1 : 2);
  tips.least = lambda.z <= lambda.x ? (lambda.z <= lambda.y ? 2 : 1) : (lambda.y <= lambda.x ? 1 : 0);
  tips.middle = 3 - tips.most - tips.least;
  return tips;
}

// TSS eqs. 3, 4, unrounded. In the middle both are l / 2.
INLINE float l_row(vec3 lambda, Tips tips, float l) { return 1.5f * l * lambda[tips.least]; }
INLINE float l_column(vec3 lambda, Tips tips, float l) {
  return l * (lambda[tips.middle] + 0.5f * lambda[tips.least]);
}

// Each tip's square at its place: tip 0 in the corner of the L, tip 1 at the end of its column, tip 2 at that of its row.
INLINE vec2 l_place(Tips tips, float row, float column, float l) {
  if (tips.most == 0) return tips.middle == 2 ? vec2(column, row) : vec2(row, column);
  if (tips.most == 1) return tips.middle == 0 ? vec2(row, l - column) : vec2(column, l - row);
  return tips.middle == 0 ? vec2(l - column, row) : vec2(l - row, column);
}

// Rows of full width, l + 1, and columns of full height, l + 1.
INLINE int l_full_rows(int level) { return level % 2 == 1 ? (level + 1) / 2 : level / 2 + 1; }
INLINE int l_full_columns(int level) { return level / 2 + 1 + level % 2; }

INLINE bool l_contains(ivec2 texel, int level) {
  bool in_square = texel.x >= 0 && texel.y >= 0 && texel.x <= level && texel.y <= level;
  return in_square && (texel.y < l_full_rows(level) || texel.x < l_full_columns(level));
}

// A sample that lies on the cut has two texels; for others `copy` equals `texel`.
struct LTexels {
  ivec2 texel;
  ivec2 copy;
};

// Of a vertex of the tessellator. Its coordinates need not be exact, as the hardware's are not: they are rounded, which leaves
// the texel as it is while the row and the column are off by less than a half (TSS prints a floor, at which most levels collide).
INLINE LTexels l_texels(vec3 lambda, int level) {
  Tips tips = sorted_tips(lambda);
  float l = float(level);
  float row = floor(l_row(lambda, tips, l) + 0.5f);
  float column = floor(l_column(lambda, tips, l) + 0.5f);
  LTexels at;
  at.texel = ivec2(l_place(tips, row, column, l));
  at.copy = at.texel;
  int k = int(row);
  int c = int(column);
  bool on_edge = tips.least == 0;
  if (level % 2 == 0) {
    if (2 * c == level && on_edge) {
      at.texel = ivec2(c, level - k);
      at.copy = ivec2(level - k, c);
    }
  } else if (2 * c == level - 1 && tips.most == 2 && (on_edge || k == c)) {
    at.copy = ivec2((level + 1) / 2, level - k);
  }
  return at;
}

// Where to read the L bilinearly. This position and its four texels lie in the L even if `lambda` is a little outside the
// triangle, as it is at the pixels of an edge. What is linear in `lambda` is reproduced, but for the texels along a tip's
// diagonal (row = column) where the L is folded: there by up to 1 / (6 l) of its range over the triangle, a sixth of the largest
// step between two samples.
INLINE vec2 l_position(vec3 lambda, int level) {
  Tips tips = sorted_tips(lambda);
  float l = float(level);
  float column = clamp(l_column(lambda, tips, l), 0.0f, 0.5f * l);
  float row = clamp(l_row(lambda, tips, l), 0.0f, column);
  // At odd levels the cut runs between two texels; beyond it tip 2 goes on in the copied column.
  bool over_cut = level % 2 == 1 && tips.most == 2 && tips.middle == 1 && column > 0.5f * (l - 1.0f);
  return over_cut ? vec2(l - column, l - row) : l_place(tips, row, column, l);
}

// Texels of an L, and texel `index` of them, row by row.
INLINE int l_samples(int level) {
  int rows = l_full_rows(level);
  return (level + 1) * rows + (level + 1 - rows) * l_full_columns(level);
}

INLINE ivec2 l_sample(int index, int level) {
  int rows = l_full_rows(level);
  int below = index - (level + 1) * rows;
  if (below < 0) return ivec2(index % (level + 1), index / (level + 1));
  return ivec2(below % l_full_columns(level), rows + below / l_full_columns(level));
}

// Which section of the L a texel lies in: the tip's square, and on which side of its diagonal.
struct LSection {
  int tip;
  bool column_is_x;
};

// `texel` mirrored to the corner of its tip's square.
INLINE ivec2 l_in_square(ivec2 texel, int tip, int level) {
  return ivec2(tip == 2 ? level - texel.x : texel.x, tip == 1 ? level - texel.y : texel.y);
}

INLINE LSection l_section(ivec2 texel, int level) {
  LSection section;
  section.tip = 2 * texel.y > level ? 1 : 2 * texel.x > level ? 2 : 0;
  ivec2 at = l_in_square(texel, section.tip, level);
  section.column_is_x = at.x >= at.y;
  return section;
}

// By corner, of a section's values for its largest, middle and least coordinate.
INLINE vec3 l_by_corner(LSection section, float most, float middle, float least) {
  bool x = section.column_is_x;
  if (section.tip == 0) return x ? vec3(most, least, middle) : vec3(most, middle, least);
  if (section.tip == 1) return x ? vec3(least, most, middle) : vec3(middle, most, least);
  return x ? vec3(middle, least, most) : vec3(least, middle, most);
}

// The sample that a texel of the L shows; both texels of a sample on the cut give the same.
INLINE vec3 l_barycentric(ivec2 texel, int level) {
  LSection section = l_section(texel, level);
  ivec2 at = l_in_square(texel, section.tip, level);
  float l = float(level);
  float row = float(min(at.x, at.y));
  float least = 2.0f * row / (3.0f * l);
  float middle = (float(max(at.x, at.y)) - row / 3.0f) / l;
  return l_by_corner(section, 1.0f - least - middle, middle, least);
}

// How l_barycentric() changes from texel to texel within the texel's section.
struct LSteps {
  vec3 ddx;
  vec3 ddy;
};

INLINE LSteps l_steps(ivec2 texel, int level) {
  LSection section = l_section(texel, level);
  float step = 1.0f / float(level);
  vec3 column = l_by_corner(section, -step, step, 0.0f);
  vec3 row = l_by_corner(section, -step / 3.0f, -step / 3.0f, 2.0f * step / 3.0f);
  LSteps steps;
  steps.ddx = (section.column_is_x ? column : row) * (section.tip == 2 ? -1.0f : 1.0f);
  steps.ddy = (section.column_is_x ? row : column) * (section.tip == 1 ? -1.0f : 1.0f);
  return steps;
}

// Two Ls in one rectangle: one as it is, at the upper left, and one turned by 180 degrees. The rectangle is full at odd levels;
// at even ones l + 2 of its texels, the ends of two columns, are empty.
INLINE ivec2 l_pair_size(int level) {
  return ivec2(level + 1 + l_full_columns(level), level % 2 == 0 ? level + 2 : level + 1);
}

// From an L to its pair's rectangle and, as two half turns are none, back.
INLINE ivec2 l_pair_texel(ivec2 texel, bool turned, int level) {
  return turned ? l_pair_size(level) - 1 - texel : texel;
}
INLINE vec2 l_pair_position(vec2 position, bool turned, int level) {
  return turned ? vec2(l_pair_size(level) - 1) - position : position;
}

struct LPairTexel {
  ivec2 texel;  // of the L
  bool turned;  // which of the two
  bool empty;   // neither's
};

INLINE LPairTexel l_pair_owner(ivec2 at, int level) {
  LPairTexel owner;
  owner.turned = !l_contains(at, level);
  owner.texel = l_pair_texel(at, owner.turned, level);
  owner.empty = !l_contains(owner.texel, level);
  return owner;
}

#endif
