// GLSL of ScenePass.
#pragma once

namespace tessera::client::gles {

constexpr const char* kScenePrelude = R"(#version 300 es
precision highp float;
precision highp int;
)";

// After kScenePrelude and atlas::addressing::kGlslText. Reads: a triangle record (scene_state.h), vertex
// positions, and three texels an object: the rows of mesh space to metres relative to the eye. Writes: the
// corner's texel in the atlas, and what the whole triangle shares.
constexpr const char* kSceneVertex = R"(
uniform highp usampler2D records;
uniform highp sampler2D vertices;
uniform highp sampler2D transforms;
uniform mat4 clip_from_relative;

out vec2 texel;
flat out vec4 texel_bounds;     // centres of the first and last texel of the block's colour part
flat out vec2 coverage_offset;  // from a texel to its coverage
flat out vec4 single_color;     // a = 1: no block

ivec2 table_texel(int i) { return ivec2(i & 2047, i >> 11); }

void set_block(uvec4 record, int corner) {
  ivec2 origin = 2 * ivec2(int(record.w & 0xfffu), int(record.w >> 12 & 0xfffu));
  ivec2 size = ivec2(2 << int(record.w >> 24 & 7u), 2 << int(record.w >> 27 & 7u));
  bool masked = (record.x >> 26 & 1u) != 0u;
  int kind = int(record.x >> 22 & 7u);
  int count = kind == 0 ? 1 : kind < 3 ? 2 : 3;
  vec2 position = block_corner(count, kind - count * (count - 1) / 2, corner);
  if ((record.x >> 25 & 1u) != 0u) position = position.yx;
  vec2 last = vec2(block_color_size(size, masked) - 1);
  texel = vec2(origin) + block_corner_texel(position, last) + 0.5;
  texel_bounds = vec4(vec2(origin) + 0.5, vec2(origin) + last + 0.5);
  coverage_offset = masked ? vec2(block_coverage_offset(size)) : vec2(0.0);
}

void main() {
  uvec4 record = texelFetch(records, table_texel(gl_VertexID / 3), 0);
  int corner = gl_VertexID % 3;
  if ((record.x >> 27 & 1u) != 0u) corner = (3 - corner) % 3;  // mirrored objects: the other way round

  uint vertex = (corner == 0 ? record.x : corner == 1 ? record.y : record.z) & 0x3fffffu;
  int object = int(record.y >> 22 | record.z >> 22 << 10);
  vec4 position = vec4(texelFetch(vertices, table_texel(int(vertex)), 0).xyz, 1.0);
  vec3 relative = vec3(dot(texelFetch(transforms, table_texel(3 * object), 0), position),
                       dot(texelFetch(transforms, table_texel(3 * object + 1), 0), position),
                       dot(texelFetch(transforms, table_texel(3 * object + 2), 0), position));
  gl_Position = clip_from_relative * vec4(relative, 1.0);

  texel = vec2(0.5);
  texel_bounds = vec4(0.5);
  coverage_offset = vec2(0.0);
  single_color = vec4(vec3(uvec3(record.w, record.w >> 8, record.w >> 16) & 0xffu) / 255.0, float(record.w >> 31));
  if (record.w >> 31 == 0u) set_block(record, corner);
}
)";

// After kPicturePrelude. Reads: the atlas. Writes: colour, and alpha that multisampling turns into coverage.
constexpr const char* kSceneFragment = R"(
uniform highp sampler2D atlas;
uniform vec2 atlas_size;
uniform bool masked;
uniform bool multisampled;

in vec2 texel;
flat in vec4 texel_bounds;
flat in vec2 coverage_offset;
flat in vec4 single_color;
out vec4 color;

vec3 atlas_at(vec2 position) { return textureLod(atlas, position / atlas_size, 0.0).rgb; }

void main() {
  // At a pixel whose centre lies outside the triangle interpolation may leave the block. Not `centroid`: thin triangles
  // share most of their pixels, and each would be sampled elsewhere than where the pixel shows it.
  vec2 inside = clamp(texel, texel_bounds.xy, texel_bounds.zw);
  color = vec4(for_target(single_color.a > 0.5 ? single_color.rgb : atlas_at(inside)), 1.0);
  if (!masked) return;
  // Coverage travels as grey, 0.5 = the material's cut-off. Its luma is free of chroma's rounding.
  float coverage = dot(atlas_at(inside + coverage_offset), vec3(0.2126, 0.7152, 0.0722));
  // The edge one pixel wide, whatever the texels' size.
  float alpha = clamp((coverage - 0.5) / max(fwidth(coverage), 1e-3) + 0.5, 0.0, 1.0);
  if (single_color.a > 0.5) alpha = 1.0;
  if (alpha < (multisampled ? 1e-3 : 0.5)) discard;
  color.a = alpha;
}
)";

}  // namespace tessera::client::gles
