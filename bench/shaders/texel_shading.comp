#version 460
#extension GL_GOOGLE_include_directive : require
// Shades tiles of 8x8 texels of unique textures (bench/texel_shading.h), a workgroup a tile, a dispatch a material. What a
// texel shows comes from the inverse map: its patch, by its number in unique_patches[].
#include "shading/shaders/gather.glsl"

layout(local_size_x = 64) in;

struct Tile {
  uint instance;
  uint level;
  uint x, y;  // in tiles
};
struct TexelPatch {
  uint first_triangle;  // in the index buffer / 3
  uint count;           // of its triangles
  uint place, size;     // x | y << 16, width | height << 16, in texels of level 0
};

layout(set = 3, binding = 2, std430) readonly buffer Tiles { Tile tiles[]; };
layout(set = 3, binding = 3, std430) readonly buffer InverseMap { uint patch_of[]; };  // 64 a tile; ~0 = none
layout(set = 3, binding = 4, std430) readonly buffer TexelPatches { TexelPatch unique_patches[]; };
layout(set = 3, binding = 5, rgba8) uniform writeonly image2D pool;

void main() {
  uint tile_number = pass.first_chunk + gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
  if (tile_number >= pass.end_chunk) return;
  uint i = gl_LocalInvocationID.x;
  uint patch_number = patch_of[tile_number * 64u + i];
  if (patch_number == ~0u) return;
  Tile tile = tiles[tile_number];
  TexelPatch in_patch = unique_patches[patch_number];
  uvec2 local = uvec2(i % 8u, i / 8u);
  float scale = float(1u << tile.level);
  vec2 extent = vec2(in_patch.size & 0xffffu, in_patch.size >> 16) - 1.0;
  vec2 centre = (vec2(uvec2(tile.x, tile.y) * 8u + local) + 0.5) * scale - 0.5;
  vec2 at = clamp(centre - vec2(in_patch.place & 0xffffu, in_patch.place >> 16), vec2(0.0), extent);
  BlockPoint point = block_point(int(in_patch.count), at, extent);
  Shown shown;
  shown.triangle = point.triangle;
  shown.coverage = false;
  shown.point.weights = point.weights;
  shown.point.ddx = point.ddx * scale;
  shown.point.ddy = point.ddy * scale;
  vec3 color = shown_color(tile.instance, in_patch.first_triangle, shown);
  uvec2 slot = uvec2(tile_number % pass.atlas_size.x, tile_number / pass.atlas_size.x) * 8u;  // atlas_size: in tiles
  imageStore(pool, ivec2(slot + local), vec4(srgb_encode_color(color), 1.0));
}
