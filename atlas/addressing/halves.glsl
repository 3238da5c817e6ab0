// A slanted triangle as two right-angled ones (TSS section 3.3, fig. 8): the height on its longest edge, the base, parts it. Each
// half has the samples of a staircase (oversampling.glsl) that lies on its long side in the atlas.
#ifndef TESSERA_ADDRESSING_HALVES_GLSL
#define TESSERA_ADDRESSING_HALVES_GLSL

#include "atlas/addressing/oversampling.glsl"

const int kMaxHalfWidth = 128;  // intervals between samples, of the staircase's short side
const int kMaxHalfLength = 1024;

// Where the height meets the base, as a part of its length, TSS eq. 12: 64 codes, whose middles never leave a half empty.
INLINE float foot_from_code(int code) { return (float(code) + 0.5f) * (1.0f / 64.0f); }

// The staircase of a half with so many intervals along the height and along its part of the base.
INLINE ivec2 half_staircase(int across, int along) { return ivec2(min(across, along), max(across, along)); }

// A point of the triangle, by half: how far up the height, and from the height's foot to the half's tip. Both 0..1 and their sum
// too, for points of the triangle.
struct HalfPoint {
  int half_number;
  float up;
  float out_along;
};

// `base` = the coordinate of the base's second corner, `up` = that of the apex. Points beside the triangle are moved into it
// along its height, so that they keep their place along the base: a pixel's centre may lie many heights away from a sliver that
// its samples hit.
INLINE HalfPoint half_point(float base, float up, float foot) {
  HalfPoint at;
  float from_foot = base - foot * (1.0f - up);
  at.half_number = from_foot < 0.0f ? 0 : 1;
  float part = from_foot < 0.0f ? -from_foot / foot : from_foot / (1.0f - foot);
  at.out_along = min(part, 1.0f);
  at.up = clamp(up, 0.0f, 1.0f - at.out_along);
  return at;
}

// Where to read it, from the upper left sample of the half's rectangle in the atlas. Its four texels lie in the staircase.
INLINE vec2 half_position(HalfPoint at, int across, int along, bool turned) {
  float x = at.out_along * float(along);
  float y = at.up * float(across);
  vec2 stair = across <= along ? vec2(x, y) : vec2(y, x);
  ivec2 size = half_staircase(across, along);
  return turned ? vec2(float(size.y) - stair.x, float(size.x) - stair.y) : stair;
}

// The texel of a staircase's sample, from the upper left one.
INLINE ivec2 half_texel(ivec2 sample_at, ivec2 size, bool turned) {
  return turned ? ivec2(size.y - sample_at.y, size.x - sample_at.x) : ivec2(sample_at.y, sample_at.x);
}

// The inverse of both: the sample that a texel shows; staircase_contains() says whether there is one.
INLINE ivec2 half_sample(ivec2 texel, ivec2 size, bool turned) {
  return turned ? ivec2(size.x - texel.y, size.y - texel.x) : ivec2(texel.y, texel.x);
}

// Coordinates of the base's second corner and of the apex, of a sample; and how they change by a step along the base and up the
// height. Samples beyond the half's third side lie outside the triangle: up to one step.
struct HalfSample {
  vec2 weights;
  vec2 step_along;
  vec2 step_up;
};

INLINE HalfSample half_weights(ivec2 sample_at, int across, int along, int half_number, float foot) {
  int out_steps = across <= along ? sample_at.y : sample_at.x;
  int up_steps = across <= along ? sample_at.x : sample_at.y;
  float part = half_number == 0 ? -foot : 1.0f - foot;
  HalfSample at;
  at.step_along = vec2(part / float(along), 0.0f);
  at.step_up = vec2(-foot, 1.0f) / float(across);
  at.weights = vec2(foot, 0.0f) + float(out_steps) * at.step_along + float(up_steps) * at.step_up;
  return at;
}

#endif
