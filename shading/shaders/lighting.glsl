// Lights and shadow maps. Reads: set 2 (Lighting). C++ twin of the records: shading/light_records.h.
#ifndef TESSERA_LIGHTING_GLSL
#define TESSERA_LIGHTING_GLSL

#include "shading/shaders/brdf.glsl"
#include "shading/shaders/features.glsl"

struct LightRecord {
  vec4 position_range;   // relative to the instant's origin; w = 1 / range, 0 = unlimited
  vec4 direction_scale;  // unit, the way the light shines; w = cone scale (0: a point light)
  vec4 color_offset;     // color * intensity; w = cone offset
};

// The sun's first if it has one, then one for each shadowed spot.
struct ShadowRecord {
  mat4 clip_from_relative;
  vec4 rectangle;  // of its map in the image: offset and size in [0, 1]
  vec4 texel;      // x = side of a texel in metres (sun) or per metre of distance (spot); zw = in the image, in [0, 1]
};

// Uniform buffers where every sample reads the same: on the software device such a load costs next to nothing, while one
// from a storage buffer is repeated for each sample.
const uint kMaxLeadingLights = 16;
layout(set = 2, binding = 0, std140) uniform LightingRecord {
  vec4 ambient_sky;     // rgb radiance from above; a = exposure
  vec4 ambient_ground;  // rgb radiance from below
  vec4 grid_min;        // relative to the instant's origin
  vec4 grid_scale;      // cells per metre
  uvec4 grid_size;      // cells per axis; w = index of the cell for everything outside
  LightRecord leading_lights[kMaxLeadingLights];  // directional ones, then shadowed spots
  ShadowRecord shadows[kMaxLeadingLights];
};
const uint kMaxGridLights = 256;
layout(set = 2, binding = 1, std140) uniform GridLights { LightRecord grid_lights[kMaxGridLights]; };
layout(set = 2, binding = 2) uniform sampler2D sun_shadow_map;    // reversed depth: nearer to the light is greater
layout(set = 2, binding = 3) uniform sampler2D spot_shadow_maps;  // side by side
layout(set = 2, binding = 4, std430) readonly buffer Cells { uvec2 cells[]; };  // first, count in cell_lights[]
layout(set = 2, binding = 5, std430) readonly buffer CellLights { uint cell_lights[]; };

// Share of a 3x3 texel box around `uv`, placed continuously, that `depth` reaches: 16 comparisons, weighted.
float filtered_visibility(sampler2D map, vec2 uv, float depth, vec2 lowest, vec2 highest) {
  vec2 size = vec2(textureSize(map, 0));
  vec2 t = uv * size - 0.5;
  vec2 base = floor(t);
  vec2 f = t - base;
  vec2 p0 = clamp(base / size, lowest, highest), p1 = clamp((base + 2.0) / size, lowest, highest);
  // Gathers give the texels (left, lower), (right, lower), (right, upper), (left, upper) around a corner.
  vec4 lit00 = vec4(greaterThanEqual(vec4(depth), textureGather(map, p0)));
  vec4 lit10 = vec4(greaterThanEqual(vec4(depth), textureGather(map, vec2(p1.x, p0.y))));
  vec4 lit01 = vec4(greaterThanEqual(vec4(depth), textureGather(map, vec2(p0.x, p1.y))));
  vec4 lit11 = vec4(greaterThanEqual(vec4(depth), textureGather(map, p1)));
  vec4 wx = vec4(1.0 - f.x, 1.0, 1.0, f.x), wy = vec4(1.0 - f.y, 1.0, 1.0, f.y);
  float row0 = dot(wx, vec4(lit00.w, lit00.z, lit10.w, lit10.z));
  float row1 = dot(wx, vec4(lit00.x, lit00.y, lit10.x, lit10.y));
  float row2 = dot(wx, vec4(lit01.w, lit01.z, lit11.w, lit11.z));
  float row3 = dot(wx, vec4(lit01.x, lit01.y, lit11.x, lit11.y));
  return dot(wy, vec4(row0, row1, row2, row3)) / 9.0;
}

// Moves the lookup off the surface by what the filter's reach and the texel's size make of the surface's slope.
vec3 shadow_lookup_point(vec3 position, vec3 normal, vec3 l, float texel_m) {
  float n_l = dot(normal, l);
  float sine = sqrt(clamp(1.0 - n_l * n_l, 0.0, 1.0));
  return position + texel_m * ((n_l < 0.0 ? -1.0 : 1.0) * (0.5 + 2.0 * sine) * normal + 0.5 * l);
}

float shadow_visibility(sampler2D map, ShadowRecord s, vec3 lookup) {
  vec4 clip = s.clip_from_relative * vec4(lookup, 1.0);
  if (clip.w <= 0.0) return 1.0;
  vec2 uv = vec2(0.5, -0.5) * clip.xy / clip.w + 0.5;
  if (any(lessThan(uv, vec2(0.0))) || any(greaterThan(uv, vec2(1.0)))) return 1.0;
  vec2 lowest = s.rectangle.xy + s.texel.zw, highest = s.rectangle.xy + s.rectangle.zw - s.texel.zw;
  return filtered_visibility(map, s.rectangle.xy + uv * s.rectangle.zw, clip.z / clip.w, lowest, highest);
}

float sun_visibility(vec3 position, vec3 normal, vec3 l) {
  ShadowRecord s = shadows[0];
  return shadow_visibility(sun_shadow_map, s, shadow_lookup_point(position, normal, l, s.texel.x));
}

float spot_visibility(uint spot, vec3 position, vec3 normal, vec3 l, float distance) {
  ShadowRecord s = shadows[kSunShadows + spot];
  return shadow_visibility(spot_shadow_maps, s,
                           shadow_lookup_point(position, normal, l, s.texel.x * distance));
}

// Direction to a local light and what of its intensity arrives.
struct Incidence {
  vec3 l;
  float distance;
  vec3 radiance;
};

Incidence local_incidence(LightRecord light, vec3 position, vec3 normal) {
  vec3 to_light = light.position_range.xyz - position;
  float distance2 = dot(to_light, to_light);
  Incidence i;
  i.l = safe_normalize(to_light, normal);
  i.distance = sqrt(distance2);
  float cone = cone_falloff(-dot(light.direction_scale.xyz, i.l), light.direction_scale.w, light.color_offset.w);
  i.radiance = light.color_offset.rgb * (cone * distance_falloff(distance2, light.position_range.w));
  return i;
}

uvec2 grid_cell(vec3 position) {
  vec3 c = (position - grid_min.xyz) * grid_scale.xyz;
  bool inside = all(greaterThanEqual(c, vec3(0.0))) && all(lessThan(c, vec3(grid_size.xyz)));
  uvec3 u = uvec3(clamp(c, vec3(0.0), vec3(grid_size.xyz - 1u)));
  return cells[inside ? (u.z * grid_size.y + u.y) * grid_size.x + u.x : grid_size.w];
}

// What all lights but the ambient one reflect towards `v`. `normal` for shading, `geometric` against self-shadowing.
vec3 direct_light(Substance s, vec3 position, vec3 geometric, vec3 normal, vec3 v) {
  vec3 sum = vec3(0.0);
  for (uint i = 0; i < kDirectionalLights; ++i) {
    vec3 l = -leading_lights[i].direction_scale.xyz;
    vec3 light = leading_lights[i].color_offset.rgb * reflected(s, normal, v, l);
    if (i < kSunShadows) light *= sun_visibility(position, geometric, l);
    sum += light;
  }
  for (uint i = 0; i < kSpotShadows; ++i) {
    Incidence in_ = local_incidence(leading_lights[kDirectionalLights + i], position, normal);
    sum += in_.radiance * reflected(s, normal, v, in_.l) *
           spot_visibility(i, position, geometric, in_.l, in_.distance);
  }
  if (kGridLights > 0u) {
    uvec2 cell = grid_cell(position);
    for (uint i = 0; i < cell.y; ++i) {
      Incidence in_ = local_incidence(grid_lights[cell_lights[cell.x + i]], position, normal);
      sum += in_.radiance * reflected(s, normal, v, in_.l);
    }
  }
  return sum;
}

#endif
