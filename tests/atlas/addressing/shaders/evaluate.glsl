// Every function of atlas/addressing by number, so that one list of questions can be put to each of its compilations.
#include "atlas/addressing/block.glsl"
#include "atlas/addressing/halves.glsl"
#include "atlas/addressing/l_packing.glsl"
#include "atlas/addressing/oversampling.glsl"
#include "atlas/addressing/perspective.glsl"
#include "atlas/addressing/split.glsl"
#include "atlas/addressing/tessellation.glsl"

const int kLevels = 0, kTexels = 1, kPosition = 2, kPairTexel = 3, kPairPosition = 4, kSampleId = 5, kStaircase = 6, kSurface = 7,
          kGrid = 8, kRatio = 9, kBlockPoint = 10, kBlockCorner = 11, kSample = 12, kSplitPoint = 13, kSplitPlace = 14, kPairPlace = 15, kHalfTexel = 16,
          kHalfPoint = 17, kHalfWeights = 18, kFunctions = 19;

struct Answer {
  ivec4 n;
  vec4 x;
};

Answer evaluate(int function, ivec4 n, vec4 x) {
  vec3 lambda = vec3(x.x, x.y, x.z);
  Answer a;
  a.n = ivec4(0);
  a.x = vec4(0.0f);
  if (function == kLevels) {
    TessellationLevels levels = tessellation_levels(n.x);
    a.n = ivec4(levels.outer.x, levels.outer.y, levels.inner, tessellation_vertices(n.y));
  } else if (function == kTexels) {
    LTexels at = l_texels(lambda, n.x);
    a.n = ivec4(at.texel.x, at.texel.y, at.copy.x, at.copy.y);
  } else if (function == kPosition) {
    vec2 at = l_position(lambda, n.x);
    a.x = vec4(at.x, at.y, 0.0f, 0.0f);
  } else if (function == kPairTexel) {
    LPairTexel owner = l_pair_owner(ivec2(n.y, n.z), n.x);
    vec3 shown = owner.empty ? vec3(0.0f) : l_barycentric(owner.texel, n.x);
    a.n = ivec4(owner.texel.x, owner.texel.y, owner.turned ? 1 : 0, owner.empty ? 1 : 0);
    a.x = vec4(shown.x, shown.y, shown.z, 0.0f);
  } else if (function == kPairPosition) {
    vec2 at = l_pair_position(vec2(x.x, x.y), n.y == 1, n.x);
    ivec2 texel = l_pair_texel(ivec2(n.z, n.w), n.y == 1, n.x);
    ivec2 size = l_pair_size(n.x);
    a.n = ivec4(texel.x, texel.y, size.x, size.y);
    a.x = vec4(at.x, at.y, 0.0f, 0.0f);
  } else if (function == kSampleId) {
    TessellationLevels levels;
    levels.outer = ivec3(n.x, n.y, n.z);
    levels.inner = n.w;
    a.n.x = oversampling_id(lambda, levels);
  } else if (function == kStaircase) {
    ivec2 size = ivec2(n.y, n.z);
    ivec2 at = staircase_position(n.x, size);
    a.n = ivec4(at.x, at.y, staircase_samples(size), staircase_row(at.y, size));
  } else if (function == kSurface || function == kGrid) {
    vec2 ratios = vec2(ratio_from_code(n.x), ratio_from_code(n.y));
    vec3 moved = function == kSurface ? to_surface(lambda, ratios) : to_grid(lambda, ratios);
    a.x = vec4(moved.x, moved.y, moved.z, 0.0f);
  } else if (function == kRatio) {
    a.n.x = ratio_code(x.x);
    a.x.x = ratio_from_code(n.x);
  } else if (function == kBlockPoint) {
    ivec2 size = ivec2(n.y, n.z);
    int count = n.x & 3;
    bool masked = (n.x & 4) != 0;
    BlockTexel part = block_half(ivec2(n.w & 1023, n.w >> 10), size, masked);
    BlockPosition position = block_position(part.texel, block_color_size(size, masked), (n.x & 8) != 0);
    BlockPoint p = block_point(count, position.at, position.extent);
    a.n = ivec4(p.triangle, part.coverage ? 1 : 0, part.texel.x, part.texel.y);
    a.x = (n.x & 16) == 0 ? vec4(p.weights.x, p.weights.y, p.ddx.x, p.ddx.y) : vec4(p.ddy.x, p.ddy.y, 0.0f, 0.0f);
  } else if (function == kBlockCorner) {
    vec2 at = block_corner_texel(block_corner(n.x, n.y, n.z), vec2(x.x, x.y));
    ivec2 offset = block_coverage_offset(ivec2(int(x.x), int(x.y)));
    a.n = ivec4(offset.x, offset.y, 0, 0);
    a.x = vec4(at.x, at.y, 0.0f, 0.0f);
  } else if (function == kSample) {
    ivec2 at = l_sample(n.y, n.x);
    LSteps steps = l_steps(at, n.x);
    a.n = ivec4(at.x, at.y, l_samples(n.x), 0);
    a.x = vec4(steps.ddx.y, steps.ddx.z, steps.ddy.y, steps.ddy.z);
  } else if (function == kSplitPoint) {
    SplitPoint point = split_point(lambda, n.x);
    a.n.x = point.index;
    a.x = vec4(point.lambda.x, point.lambda.y, point.lambda.z, 0.0f);
  } else if (function == kSplitPlace) {
    SplitPlace place = split_place(n.y, n.x);
    a.x = vec4(place.corner.x, place.corner.y, place.scale, 0.0f);
  } else if (function == kPairPlace) {
    ivec2 at = l_pair_place(n.y, ivec2(n.z, 8), n.w, n.x, 512);
    a.n = ivec4(at.x, at.y, 0, 0);
  } else if (function == kHalfTexel) {
    ivec2 size = half_staircase(n.y, n.z);
    ivec2 texel = half_texel(ivec2(n.w & 127, n.w >> 7), size, n.x == 1);
    ivec2 back = half_sample(texel, size, n.x == 1);
    a.n = ivec4(texel.x, texel.y, back.x, back.y);
  } else if (function == kHalfPoint) {
    HalfPoint point = half_point(x.x, x.y, foot_from_code(n.x));
    vec2 at = half_position(point, n.y, n.z, n.w == 1);
    a.n.x = point.half_number;
    a.x = vec4(point.up, point.out_along, at.x, at.y);
  } else if (function == kHalfWeights) {
    HalfSample at = half_weights(ivec2(n.w & 255, n.w >> 8 & 2047), n.y, n.z, n.w >> 19, foot_from_code(n.x));
    a.x = x.x < 0.5f ? vec4(at.weights.x, at.weights.y, at.step_along.x, at.step_along.y)
                     : vec4(at.weights.x, at.weights.y, at.step_up.x, at.step_up.y);
  }
  return a;
}
