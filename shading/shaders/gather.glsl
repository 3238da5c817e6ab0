// Samples of placed patches. Reads: sets 0, 1, 2 and the blocks of set 3 (Gather). C++ twin: shading/gather_work.h.
#ifndef TESSERA_GATHER_GLSL
#define TESSERA_GATHER_GLSL

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

// The block's corners of a triangle (scene::patch_corner).
struct Corners {
  vec2 c0, c1, c2;
};

Corners block_corners(uint count, uint triangle) {
  if (count < 3u)
    return triangle == 0u ? Corners(vec2(0, 0), vec2(1, 0), vec2(0, 1))
                          : Corners(vec2(1, 1), vec2(0, 1), vec2(1, 0));
  vec2 tip = vec2(0.5, 1);
  if (triangle == 0u) return Corners(vec2(0, 0), vec2(1, 0), tip);
  return triangle == 1u ? Corners(vec2(0, 1), vec2(0, 0), tip) : Corners(vec2(1, 0), vec2(1, 1), tip);
}

// Which triangle of the patch holds block position `at`, for a block that spans `extent` and has its tip at `tip_u`.
uint triangle_at(uint count, vec2 at, vec2 extent, float tip_u) {
  if (count == 1u) return 0u;
  if (count == 2u) return at.x * extent.y + at.y * extent.x <= extent.x * extent.y ? 0u : 1u;
  if (at.x * extent.y < at.y * tip_u) return 1u;
  return (extent.x - at.x) * extent.y < at.y * (extent.x - tip_u) ? 2u : 0u;
}

// `at` = position along the patch's u and v axes in texels, `extent` = the far corner's. Corners sit at whole texels
// (atlas/placement.h), so the tip of three triangles may lie half a texel off the middle.
TrianglePoint block_point(uint count, vec2 at, vec2 extent, out uint triangle) {
  if (count == 1u) {  // the half that the triangle leaves unused repeats its long edge
    float excess = at.x / extent.x + at.y / extent.y - 1.0;
    if (excess > 0.0) at -= 0.5 * excess * extent;
  }
  triangle = triangle_at(count, at, extent, floor(0.5 * extent.x + 0.5));
  Corners c = block_corners(count, triangle);
  vec2 a = floor(c.c0 * extent + 0.5);
  vec2 e1 = floor(c.c1 * extent + 0.5) - a, e2 = floor(c.c2 * extent + 0.5) - a;
  float det = e1.x * e2.y - e1.y * e2.x;
  float inverse = det != 0.0 ? 1.0 / det : 0.0;  // two texels cannot hold three triangles
  vec2 d = at - a;
  TrianglePoint p;
  p.weights = vec2(d.x * e2.y - d.y * e2.x, e1.x * d.y - e1.y * d.x) * inverse;
  p.ddx = vec2(e2.y, -e1.y) * inverse;
  p.ddy = vec2(-e2.x, e1.x) * inverse;
  p.weights = clamp(p.weights, 0.0, 1.0);
  return p;
}

// Distance of the eye that the block was placed for, of each corner of a triangle, up to a factor.
vec3 corner_distances(uint spacing, uint count, uint triangle) {
  // Corner of the patch, by corner of the triangle (scene::Patch).
  uvec3 corner = uvec3(0, 1, 2);
  if (triangle > 0u) corner = count == 2u ? uvec3(3, 2, 1) : triangle == 1u ? uvec3(3, 0, 2) : uvec3(1, 4, 2);
  vec3 code;
  for (int i = 0; i < 3; ++i)
    code[i] = corner[i] == 0u ? 0.0 : float(bitfieldExtract(int(spacing), int(8u * (corner[i] - 1u)), 8));
  return exp2(code * (6.0 / 127.0));
}

// From a place that is even on that eye's screen to the surface (TSS eq. 5): weights go by 1 / distance.
void space_point(vec3 distances, inout TrianglePoint at) {
  vec3 inverse = 1.0 / distances;
  vec2 slope = inverse.yz - inverse.x;
  float sum = inverse.x + dot(at.weights, slope);
  vec2 scaled = at.weights * inverse.yz;
  at.weights = scaled / sum;
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
  uvec2 size = block_size(block);
  bool is_coverage = false;
  if ((block.shape & kBlockMasked) != 0u) {
    if (size.x > size.y) {
      size.x >>= 1;
      is_coverage = texel.x >= size.x;
      texel.x -= is_coverage ? size.x : 0u;
    } else {
      size.y >>= 1;
      is_coverage = texel.y >= size.y;
      texel.y -= is_coverage ? size.y : 0u;
    }
  }
  uint count = block.shape & 3u;
  vec2 at = vec2(texel), extent = vec2(size) - 1.0;
  // A side of one texel stands for the middle of its axis.
  if (extent.x < 0.5) { extent.x = 1.0; at.x = 0.5; }
  if (extent.y < 0.5) { extent.y = 1.0; at.y = 0.5; }
  if ((block.shape & kBlockTransposed) != 0u) {
    at = at.yx;
    extent = extent.yx;
  }
  // The client's bilinear fetch smooths once more: half a texel's filter keeps the sum near one texel.
  float footprint = 0.5;
  if ((block.shape & kBlockColor) != 0u) {
    extent = vec2(2.0);
    at = count == 1u ? vec2(2.0 / 3.0) : vec2(1.0);
    footprint = 2.0;
  }
  uint triangle;
  TrianglePoint point = block_point(count, at, extent, triangle);
  if (block.spacing != 0u) space_point(corner_distances(block.spacing, count, triangle), point);
  point.ddx *= footprint;
  point.ddy *= footprint;
  Stand stand = load_stand(block.instance);
  Triangle t = fetch_triangle(stand, block.first_triangle + triangle);
  see_point(t, point);
  SurfacePoint p = surface_point(stand, t, point);
  MaterialPoint m = material_point(p);
  if (is_coverage) return vec3(srgb_decode(coverage(m.base.a, material.alpha_cutoff)));
  return shade(p, m, pass.eye.xyz);
}

#endif
