// GLSL of ScenePass.
#pragma once

namespace tessera::client::gles {

constexpr const char* kScenePrelude = R"(#version 300 es
precision highp float;
precision highp int;
)";

// After kScenePrelude and atlas::addressing::kGlslText. Reads: the two texels of a triangle record
// (scene_state.h), vertex positions, and three texels an object: the rows of mesh space to metres relative to
// the eye. Writes: the corner's texel in the atlas, and what the whole triangle shares.
constexpr const char* kSceneVertex = R"(
uniform highp usampler2D records;
uniform highp sampler2D vertices;
uniform highp sampler2D transforms;
uniform mat4 clip_from_relative;

// Block: texel within it, and 1; L and halves: the corner's weights.
out vec3 even;
out vec3 spaced;                // times the corner's distance from the eye that it is for
flat out vec2 reach;            // the least and the largest of the three distances
flat out int form;              // as below
flat out uvec4 place;           // of an L and of halves: the record's shape
flat out vec2 origin;           // of the block, in texels
flat out vec2 last;             // centre of the last texel of the block's colour part, from the origin; of the first: 0.5
flat out vec2 coverage_offset;  // from a texel to its coverage
flat out vec4 single_color;     // a = 1: no block

const int kFormBlock = 0, kFormL = 6, kFormHalves = 7;  // block or colour; else corner kinds (scene_state.h)

ivec2 table_texel(int i) { return ivec2(i & 2047, i >> 11); }

float distance_of(uvec4 shape, int corner) {
  int code = int(shape.z << (24 - 8 * corner)) >> 24;
  return ratio_from_code(code + kRatioCodeOne);
}

void set_block(uvec4 shape, uint what, int corner) {
  origin = vec2(uvec2(shape.x, shape.x >> 16) & 0xffffu);
  ivec2 size = ivec2(uvec2(shape.y, shape.y >> 16) & 0xffffu);
  bool masked = (what >> 28 & 1u) != 0u;
  int kind = int(what >> 24 & 7u);
  int count = kind == 0 ? 1 : kind < 3 ? 2 : 3;
  vec2 position = block_corner(count, kind - count * (count - 1) / 2, corner);
  if ((what >> 27 & 1u) != 0u) position = position.yx;
  vec2 extent = vec2(block_color_size(size, masked) - 1);
  last = extent + 0.5;
  even = vec3(block_corner_texel(position, extent) + 0.5, 1.0);
  coverage_offset = masked ? vec2(block_coverage_offset(size)) : vec2(0.0);
}

void main() {
  int first_texel = 2 * (gl_VertexID / 3);
  uvec4 corners = texelFetch(records, table_texel(first_texel), 0);
  uvec4 shape = texelFetch(records, table_texel(first_texel + 1), 0);
  uint what = corners.w;
  int corner = gl_VertexID % 3;
  if ((what >> 29 & 1u) != 0u) corner = (3 - corner) % 3;  // mirrored objects: the other way round

  uint vertex = corner == 0 ? corners.x : corner == 1 ? corners.y : corners.z;
  int object = int(what & 0xffffffu);
  vec4 position = vec4(texelFetch(vertices, table_texel(int(vertex)), 0).xyz, 1.0);
  vec3 relative = vec3(dot(texelFetch(transforms, table_texel(3 * object), 0), position),
                       dot(texelFetch(transforms, table_texel(3 * object + 1), 0), position),
                       dot(texelFetch(transforms, table_texel(3 * object + 2), 0), position));
  gl_Position = clip_from_relative * vec4(relative, 1.0);

  int kind = int(what >> 24 & 7u);
  form = kFormBlock;
  place = shape;
  even = vec3(0.5, 0.5, 1.0);
  spaced = even;
  reach = vec2(1.0);
  origin = vec2(0.0);
  last = vec2(0.5);
  coverage_offset = vec2(0.0);
  bool is_single = (what >> 30 & 1u) != 0u;
  single_color = vec4(vec3(uvec3(shape.x, shape.x >> 8, shape.x >> 16) & 0xffu) / 255.0, is_single ? 1.0 : 0.0);
  if (is_single) return;
  if (kind < kFormL) {
    set_block(shape, what, corner);
  } else {
    form = kind;
    even = vec3(corner == 0, corner == 1, corner == 2);
  }
  // Interpolated on the surface, then divided: even on the screen of that eye (TSS eq. 5).
  vec3 distances = vec3(distance_of(shape, 0), distance_of(shape, 1), distance_of(shape, 2));
  spaced = distances[corner] * even;
  reach.x = min(distances.x, min(distances.y, distances.z));
  reach.y = max(distances.x, max(distances.y, distances.z));
}
)";

// After kPicturePrelude and atlas::addressing::kGlslText. Reads: the atlas. Writes: colour, and alpha that
// multisampling turns into coverage.
constexpr const char* kSceneFragment = R"(
uniform highp sampler2D atlas;
uniform vec2 atlas_size;
uniform bool masked;
uniform bool multisampled;

in vec3 even;
in vec3 spaced;
flat in vec2 reach;
flat in int form;
flat in uvec4 place;
flat in vec2 origin;
flat in vec2 last;
flat in vec2 coverage_offset;
flat in vec4 single_color;
out vec4 color;

vec3 atlas_at(vec2 position) { return textureLod(atlas, position / atlas_size, 0.0).rgb; }

const int kFormL = 6, kFormHalves = 7;

struct Places {
  vec2 color;
  vec2 coverage;
};

// At a pixel whose centre lies outside the triangle interpolation may leave the shape, and what it is divided by may vanish:
// where it is not between those of the corners, samples count as evenly spaced. Not `centroid`: thin triangles share most of
// their pixels, and each would be sampled elsewhere than where the pixel shows it.
bool is_between(float distance) { return distance >= reach.x && distance <= reach.y; }

Places in_block() {
  Places at;
  at.color = origin + clamp(is_between(spaced.z) ? spaced.xy / spaced.z : even.xy, vec2(0.5), last);
  at.coverage = at.color + coverage_offset;
  return at;
}

vec3 on_grid() {
  float sum = spaced.x + spaced.y + spaced.z;
  return is_between(sum) ? spaced / sum : even;
}

vec3 in_triangle(vec3 grid) {
  vec3 inside = max(grid, 0.0);
  return inside / (inside.x + inside.y + inside.z);  // at least 1: the three make 1
}

Places in_l() {
  int level = int(place.x >> 24 & 63u) + 1;
  ivec2 first = 2 * ivec2(uvec2(place.x, place.x >> 12) & 0xfffu);
  bool split = place.x >> 31 != 0u;
  SplitPoint point = split_point(in_triangle(on_grid()), split ? int(place.y & 0xffu) : 1);
  // Number of the half pair.
  int number = masked ? 2 * point.index : point.index + int(place.x >> 30 & 1u);
  vec2 pair = vec2(l_pair_place(number / 2, first, 2 * int(place.y >> 8), level, int(atlas_size.x))) + 0.5;
  vec2 position = l_position(point.lambda, level);
  Places at;
  at.color = pair + l_pair_position(position, number % 2 == 1, level);
  at.coverage = pair + l_pair_position(position, true, level);
  return at;
}

Places in_halves() {
  vec3 grid = on_grid();  // half_point() moves it into the triangle
  int apex = int(place.x >> 26 & 3u);
  HalfPoint point = half_point(grid[(apex + 2) % 3], grid[apex], foot_from_code(int(place.y >> 26)));
  uint half_place = point.half_number == 0 ? place.x : place.y;
  int along = int(place.w >> (point.half_number == 0 ? 7 : 17) & 0x3ffu) + 1;
  vec2 corner = vec2(half_place & 0x1fffu, 2u * (half_place >> 13 & 0xfffu)) + 0.5;
  Places at;
  at.color = corner + half_position(point, int(place.w & 0x7fu) + 1, along, (half_place >> 25 & 1u) != 0u);
  at.coverage = at.color;
  return at;
}

void main() {
  Places at;
  if (form == kFormL) {
    at = in_l();
  } else if (form == kFormHalves) {
    at = in_halves();
  } else {
    at = in_block();
  }
  color = vec4(for_target(single_color.a > 0.5 ? single_color.rgb : atlas_at(at.color)), 1.0);
  if (!masked) return;
  // Coverage travels as grey, 0.5 = the material's cut-off. Its luma is free of chroma's rounding.
  float coverage = dot(atlas_at(at.coverage), vec3(0.2126, 0.7152, 0.0722));
  // The edge one pixel wide, whatever the texels' size.
  float alpha = clamp((coverage - 0.5) / max(fwidth(coverage), 2.5e-4) + 0.5, 0.0, 1.0);
  if (single_color.a > 0.5 || form == kFormHalves) alpha = 1.0;
  if (alpha < (multisampled ? 1e-3 : 0.5)) discard;
  color.a = alpha;
}
)";

}  // namespace tessera::client::gles
