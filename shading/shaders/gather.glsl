// Samples of placed patches. Reads: sets 0, 1, 2 and the blocks of set 3 (Gather). C++ twin: shading/gather_work.h.
#ifndef TESSERA_GATHER_GLSL
#define TESSERA_GATHER_GLSL

#include "atlas/addressing/block.glsl"
#include "atlas/addressing/halves.glsl"
#include "atlas/addressing/perspective.glsl"
#include "atlas/addressing/split.glsl"
#include "shading/shaders/material.glsl"

struct Block {
  uint instance;
  uint first_triangle;  // of the patch, or the one that it is for, in the index buffer / 3
  uint place;           // x | y << 16 in texels, of an L its pair's; or the slot of a single colour
  // Block: width | height << 16 in texels; 1 x 1 for a single colour.
  // L:     level (7) | splits (5) | number of the sub-triangle (10)
  // Half:  across (8) | along (11) | foot (6) | apex (2) | which half (1)
  uint size;
  uint shape;           // triangle count, 1 of an L and a half | flags
  uint spacing;         // codes of corners 1..4
  uint first_sample;    // compute path: of the whole dispatch; tessellation path: of the half, where this part of it begins
};
const uint kBlockTransposed = 1u << 2, kBlockMasked = 1u << 3, kBlockColor = 1u << 4, kBlockL = 1u << 5, kBlockHalf = 1u << 6,
           kBlockTurned = 1u << 7;

layout(set = 3, binding = 1, std430) readonly buffer Blocks { Block blocks[]; };

layout(push_constant) uniform Pass {
  vec4 eye;            // relative to the instant's origin
  vec4 axis;           // unit, where the viewer looks
  vec4 ray_x, ray_y;   // from pixel to pixel, at distance 1 along the axis
  uvec2 atlas_size;
  uint first_chunk, end_chunk;  // compute path
} pass;

uvec2 block_size(Block block) { return uvec2(block.size & 0xffffu, block.size >> 16); }
bool has_flag(Block block, uint flag) { return (block.shape & flag) != 0u; }
int l_level(Block block) { return int(block.size & 0x7fu); }
int half_across(Block block) { return int(block.size & 0xffu); }
int half_along(Block block) { return int(block.size >> 8 & 0x7ffu); }
ivec2 half_stairs(Block block) { return half_staircase(half_across(block), half_along(block)); }

// Its samples, a number of them, and the texel of one; texels count from the upper left corner of its rectangle. That of an L
// holds another L too.
uint block_samples(Block block) {
  if (has_flag(block, kBlockL)) return uint(l_samples(l_level(block))) * (has_flag(block, kBlockMasked) ? 2u : 1u);
  if (has_flag(block, kBlockHalf)) return uint(staircase_samples(half_stairs(block)));
  return (block.size & 0xffffu) * (block.size >> 16);
}

ivec2 block_sample(Block block, uint i) {
  bool turned = has_flag(block, kBlockTurned);
  if (has_flag(block, kBlockL)) {
    uint samples = uint(l_samples(l_level(block)));
    return l_pair_texel(l_sample(int(i % samples), l_level(block)), turned || i >= samples, l_level(block));
  }
  if (has_flag(block, kBlockHalf)) return half_texel(staircase_position(int(i), half_stairs(block)), half_stairs(block), turned);
  uint width = block_size(block).x;
  return ivec2(i % width, i / width);
}

uvec2 block_rectangle(Block block) {
  if (has_flag(block, kBlockL)) return uvec2(l_pair_size(l_level(block)));
  if (has_flag(block, kBlockHalf)) return uvec2(half_stairs(block).yx + 1);
  return block_size(block);
}

bool block_has(Block block, ivec2 texel) {
  if (has_flag(block, kBlockL)) {
    LPairTexel owner = l_pair_owner(texel, l_level(block));
    return !owner.empty && (has_flag(block, kBlockMasked) || owner.turned == has_flag(block, kBlockTurned));
  }
  if (has_flag(block, kBlockHalf))
    return staircase_contains(half_sample(texel, half_stairs(block), has_flag(block, kBlockTurned)), half_stairs(block));
  return true;
}

// Distance of the eye that the block was placed for, of each corner of a triangle, up to a factor.
vec3 corner_distances(uint spacing, uint count, int triangle) {
  // Corner of the patch, by corner of the triangle (scene::Patch).
  uvec3 corner = uvec3(0, 1, 2);
  if (triangle > 0) corner = count == 2u ? uvec3(3, 2, 1) : triangle == 1 ? uvec3(3, 0, 2) : uvec3(1, 4, 2);
  vec3 distances = vec3(1.0);
  for (int i = 0; i < 3; ++i)
    if (corner[i] > 0u)
      distances[i] = ratio_from_code(bitfieldExtract(int(spacing), int(8u * corner[i] - 8u), 8) + kRatioCodeOne);
  return distances;
}

// From a place that is even on that eye's screen to the surface (TSS eq. 5): weights go by 1 / distance. Beyond the triangle
// lies the horizon of its plane: what comes near it is moved into the triangle.
void space_point(vec3 distances, inout TrianglePoint at) {
  vec3 inverse = 1.0 / distances;
  vec2 slope = inverse.yz - inverse.x;
  float sum = inverse.x + dot(at.weights, slope);
  if (sum < 0.5 * min(inverse.x, min(inverse.y, inverse.z))) {
    vec3 inside = max(vec3(1.0 - at.weights.x - at.weights.y, at.weights), 0.0);
    at.weights = inside.yz / (inside.x + inside.y + inside.z);
    sum = inverse.x + dot(at.weights, slope);
  }
  at.weights *= inverse.yz / sum;
  at.ddx = (at.ddx * inverse.yz - at.weights * dot(at.ddx, slope)) / sum;
  at.ddy = (at.ddy * inverse.yz - at.weights * dot(at.ddy, slope)) / sum;
}

// How the weights change over a pixel of the viewer: a texel that is finer than the pixel must not carry more detail than
// the pixel can show, or the client, which has no mip-maps, would alias. Same derivation as triangle_point() in view.glsl.
void see_point(Triangle t, inout TrianglePoint at) {
  vec3 from_eye = t.a + at.weights.x * t.edge1 + at.weights.y * t.edge2 - pass.eye.xyz;
  vec3 to_eye = pass.eye.xyz - t.a;
  vec3 p = cross(t.edge2, to_eye), q = cross(to_eye, t.edge1), n = cross(t.edge2, t.edge1);
  // Beside and behind the viewer the distance stands in for the depth; edge-on views are filtered for a slant of 1:20.
  float range = length(from_eye);
  float depth = max(dot(from_eye, pass.axis.xyz), 0.25 * range);
  float det = dot(from_eye, n), least = 0.05 * range * length(n);
  det = det < 0.0 ? min(det, -least) : max(det, least);
  float scale = abs(det) > 1e-30 ? depth / det : 0.0;
  vec2 w = at.weights;
  at.seen_ddx = (vec2(dot(pass.ray_x.xyz, p), dot(pass.ray_x.xyz, q)) - w * dot(pass.ray_x.xyz, n)) * scale;
  at.seen_ddy = (vec2(dot(pass.ray_y.xyz, p), dot(pass.ray_y.xyz, q)) - w * dot(pass.ray_y.xyz, n)) * scale;
}

// Coverage as it travels in the atlas: 0.5 at the cut-off, full swing a quarter of alpha to either side; soft enough that
// bilinear filtering places the edge between texels. The swing is a quarter of what grey could have: the client asks only
// where coverage passes the cut-off, and in black and white an atlas with foliage takes a quarter more bits (docs/layouts.md).
float coverage(float alpha, float cutoff) { return 0.5 + 0.5 * clamp(alpha - cutoff, -0.25, 0.25); }

// What a texel shows, before it is spaced.
struct Shown {
  int triangle;  // after first_triangle
  TrianglePoint point;
  bool coverage;
};

// A single colour is the block's centre, filtered over the patch.
Shown shown_by_rectangle(Block block, ivec2 texel) {
  ivec2 size = ivec2(block_size(block));
  bool masked = has_flag(block, kBlockMasked);
  BlockTexel in_part = block_half(texel, size, masked);
  BlockPosition position =
      block_position(in_part.texel, block_color_size(size, masked), has_flag(block, kBlockTransposed));
  uint count = block.shape & 3u;
  float footprint = 1.0;
  if (has_flag(block, kBlockColor)) {
    position.at = count == 1u ? vec2(2.0 / 3.0) : vec2(1.0);
    position.extent = vec2(2.0);
    footprint = 4.0;
  }
  BlockPoint in_block = block_point(int(count), position.at, position.extent);
  Shown shown;
  shown.triangle = in_block.triangle;
  shown.coverage = in_part.coverage;
  shown.point.weights = in_block.weights;
  shown.point.ddx = in_block.ddx * footprint;
  shown.point.ddy = in_block.ddy * footprint;
  return shown;
}

Shown shown_by_l(Block block, ivec2 texel) {
  int level = l_level(block);
  bool masked = has_flag(block, kBlockMasked);
  bool turned = masked ? l_pair_owner(texel, level).turned : has_flag(block, kBlockTurned);
  ivec2 at = l_pair_texel(texel, turned, level);
  SplitPlace place = split_place(int(block.size >> 12), int(block.size >> 7 & 0x1fu));
  LSteps steps = l_steps(at, level);
  Shown shown;
  shown.triangle = 0;
  shown.coverage = masked && turned;
  shown.point.weights = place.corner + place.scale * l_barycentric(at, level).yz;
  shown.point.ddx = place.scale * steps.ddx.yz;
  shown.point.ddy = place.scale * steps.ddy.yz;
  return shown;
}

Shown shown_by_half(Block block, ivec2 texel) {
  ivec2 at = half_sample(texel, half_stairs(block), has_flag(block, kBlockTurned));
  HalfSample in_half = half_weights(at, half_across(block), half_along(block), int(block.size >> 27 & 1u),
                                    foot_from_code(int(block.size >> 19 & 0x3fu)));
  // From (base's second corner, apex) to the triangle's second and third corner.
  int apex = int(block.size >> 25 & 3u);
  vec3 weights, along, up;
  weights[apex] = in_half.weights.y;
  weights[(apex + 2) % 3] = in_half.weights.x;
  weights[(apex + 1) % 3] = 1.0 - in_half.weights.x - in_half.weights.y;
  along[apex] = in_half.step_along.y;
  along[(apex + 2) % 3] = in_half.step_along.x;
  along[(apex + 1) % 3] = -in_half.step_along.x - in_half.step_along.y;
  up[apex] = in_half.step_up.y;
  up[(apex + 2) % 3] = in_half.step_up.x;
  up[(apex + 1) % 3] = -in_half.step_up.x - in_half.step_up.y;
  Shown shown;
  shown.triangle = 0;
  shown.coverage = false;
  shown.point.weights = weights.yz;
  shown.point.ddx = along.yz;
  shown.point.ddy = up.yz;
  return shown;
}

Shown shown_by(Block block, ivec2 texel) {
  if (has_flag(block, kBlockL)) return shown_by_l(block, texel);
  if (has_flag(block, kBlockHalf)) return shown_by_half(block, texel);
  return shown_by_rectangle(block, texel);
}

// Display-linear colour of what a texel shows; `shown` is spaced.
vec3 shown_color(uint instance, uint first_triangle, Shown shown) {
  TrianglePoint point = shown.point;
  // The client's bilinear fetch smooths once more: half a texel's filter keeps the sum near one texel.
  point.ddx *= 0.5;
  point.ddy *= 0.5;
  Stand stand = load_stand(instance);
  Triangle t = fetch_triangle(stand, first_triangle + uint(shown.triangle));
  see_point(t, point);
  SurfacePoint p = surface_point(stand, t, point);
  MaterialPoint m = material_point(p);
  if (shown.coverage) return vec3(srgb_decode(coverage(m.base.a, material.alpha_cutoff)));
  return shade(p, m, pass.eye.xyz);
}

// Of one texel of a block, counted from the upper left corner of its rectangle.
vec3 block_texel(Block block, ivec2 texel) {
  Shown shown = shown_by(block, texel);
  if (block.spacing != 0u) space_point(corner_distances(block.spacing, block.shape & 3u, shown.triangle), shown.point);
  return shown_color(block.instance, block.first_triangle, shown);
}

#endif
