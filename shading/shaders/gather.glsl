// Samples of placed patches. Reads: sets 0, 1, 2 and the blocks of set 3 (Gather). C++ twin: shading/gather_work.h.
#ifndef TESSERA_GATHER_GLSL
#define TESSERA_GATHER_GLSL

#include "atlas/addressing/block.glsl"
#include "atlas/addressing/perspective.glsl"
#include "shading/shaders/material.glsl"

struct Block {
  uint instance;
  uint first_triangle;  // of the patch, in the index buffer / 3
  uint place;           // x | y << 16 in texels; or the slot of a single colour
  uint size;            // width | height << 16 in texels; 1 x 1 for a single colour
  uint shape;           // triangle count | flags
  uint spacing;         // codes of corners 1..4
  uint first_sample;    // compute path: of the whole dispatch
};
const uint kBlockTransposed = 1u << 2, kBlockMasked = 1u << 3, kBlockColor = 1u << 4;

layout(set = 3, binding = 1, std430) readonly buffer Blocks { Block blocks[]; };

layout(push_constant) uniform Pass {
  vec4 eye;            // relative to the instant's origin
  vec4 axis;           // unit, where the viewer looks
  vec4 ray_x, ray_y;   // from pixel to pixel, at distance 1 along the axis
  uvec2 atlas_size;
  uint first_chunk, end_chunk;  // compute path
} pass;

uvec2 block_size(Block block) { return uvec2(block.size & 0xffffu, block.size >> 16); }

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

// From a place that is even on that eye's screen to the surface (TSS eq. 5): weights go by 1 / distance.
void space_point(vec3 distances, inout TrianglePoint at) {
  vec3 inverse = 1.0 / distances;
  vec2 slope = inverse.yz - inverse.x;
  float sum = inverse.x + dot(at.weights, slope);
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

// Coverage as it travels in the atlas: 0.5 at the cut-off, full swing a quarter of alpha to either side. Steep enough
// that coding noise moves an edge little, soft enough that bilinear filtering places it between texels.
float coverage(float alpha, float cutoff) { return clamp(0.5 + 2.0 * (alpha - cutoff), 0.0, 1.0); }

// Display-linear colour of one texel of a block; `texel` counts from its upper left corner. A single colour is the
// block's centre, filtered over the patch.
vec3 block_texel(Block block, uvec2 texel) {
  ivec2 size = ivec2(block_size(block));
  bool masked = (block.shape & kBlockMasked) != 0u;
  BlockTexel in_part = block_half(ivec2(texel), size, masked);
  BlockPosition position =
      block_position(in_part.texel, block_color_size(size, masked), (block.shape & kBlockTransposed) != 0u);
  uint count = block.shape & 3u;
  // The client's bilinear fetch smooths once more: half a texel's filter keeps the sum near one texel.
  float footprint = 0.5;
  if ((block.shape & kBlockColor) != 0u) {
    position.at = count == 1u ? vec2(2.0 / 3.0) : vec2(1.0);
    position.extent = vec2(2.0);
    footprint = 2.0;
  }
  BlockPoint in_block = block_point(int(count), position.at, position.extent);
  TrianglePoint point;
  point.weights = in_block.weights;
  point.ddx = in_block.ddx;
  point.ddy = in_block.ddy;
  if (block.spacing != 0u) space_point(corner_distances(block.spacing, count, in_block.triangle), point);
  point.ddx *= footprint;
  point.ddy *= footprint;
  Stand stand = load_stand(block.instance);
  Triangle t = fetch_triangle(stand, block.first_triangle + uint(in_block.triangle));
  see_point(t, point);
  SurfacePoint p = surface_point(stand, t, point);
  MaterialPoint m = material_point(p);
  if (in_part.coverage) return vec3(srgb_decode(coverage(m.base.a, material.alpha_cutoff)));
  return shade(p, m, pass.eye.xyz);
}

#endif
