// Triangles beyond the highest level (TSS section 4, "PVS tessellation"): n^2 sub-triangles, uniform in the even grid
// (perspective.glsl), each with an L of its own. The triangle stays whole at the client; only its lookups are split. 1 <= n <= 31.
#ifndef TESSERA_ADDRESSING_SPLIT_GLSL
#define TESSERA_ADDRESSING_SPLIT_GLSL

#include "atlas/addressing/l_packing.glsl"

const int kMaxSplits = 31;

// A sub-triangle and a point of it. Row j along the third coordinate, column i along the second; one that is turned stands on
// its tip, and its corner 0 is the one with the least first coordinate.
struct SplitPoint {
  int index;    // row by row, an upright one before the turned one beside it: 0..n^2 - 1
  vec3 lambda;  // within it
};

INLINE int split_row_start(int row, int n) { return row * (2 * n - row); }

INLINE SplitPoint split_point(vec3 lambda, int n) {
  float x = max(lambda.y, 0.0f) * float(n);
  float y = max(lambda.z, 0.0f) * float(n);
  int j = min(int(y), n - 1);
  int i = min(int(x), n - 1 - j);
  float u = min(x - float(i), 1.0f);
  float v = min(y - float(j), 1.0f);
  // The last of a row has no turned one beside it.
  bool turned = u + v > 1.0f && i < n - 1 - j;
  SplitPoint at;
  at.index = split_row_start(j, n) + 2 * i + (turned ? 1 : 0);
  at.lambda = turned ? vec3(u + v - 1.0f, 1.0f - u, 1.0f - v) : vec3(1.0f - u - v, u, v);
  return at;
}

// The sub-triangle's place in the triangle: lambda = corner + scale * (lambda within it), for its second and third coordinate.
struct SplitPlace {
  vec2 corner;
  float scale;
};

INLINE SplitPlace split_place(int index, int n) {
  // n^2 - index is above the square of n - 1 - row, and at most that of n - row. The root is rounded: set right.
  int left = n * n - index;
  int rows = int(sqrt(float(left)));
  if (rows * rows < left) ++rows;
  if ((rows - 1) * (rows - 1) >= left) --rows;
  int j = n - rows;
  int in_row = index - split_row_start(j, n);
  int turned = in_row % 2;
  SplitPlace place;
  place.corner = vec2(float(in_row / 2 + turned), float(j + turned)) / float(n);
  place.scale = (turned == 1 ? -1.0f : 1.0f) / float(n);
  return place;
}

// Pairs stand side by side in rows; their rectangles are rounded up to even sides, so that they own their chroma samples.
INLINE ivec2 l_pair_pitch(int level) {
  ivec2 size = l_pair_size(level);
  return ivec2(size.x + size.x % 2, size.y + size.y % 2);
}

// Upper left corner of pair `index` of those that start at `first` and go on at the left end of the rows from `next_y` on, in an
// atlas that holds at least one pair in a row.
INLINE ivec2 l_pair_place(int index, ivec2 first, int next_y, int level, int atlas_width) {
  ivec2 pitch = l_pair_pitch(level);
  int in_first_row = (atlas_width - first.x) / pitch.x;
  if (index < in_first_row) return ivec2(first.x + index * pitch.x, first.y);
  int rest = index - in_first_row;
  int in_row = atlas_width / pitch.x;
  return ivec2(rest % in_row * pitch.x, next_y + rest / in_row * pitch.y);
}

#endif
