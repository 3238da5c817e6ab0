// The one material of every pass: what colour a surface point shows to an eye. Reads: sets 0, 1, 2, and
// binding 0 of set 3.
#ifndef TESSERA_MATERIAL_GLSL
#define TESSERA_MATERIAL_GLSL

#include "scene/shaders/scene.glsl"
#include "shading/shaders/color.glsl"
#include "shading/shaders/lighting.glsl"
#include "shading/shaders/surface.glsl"

// Of all samples of this draw or dispatch (MaterialGroups).
layout(set = 3, binding = 0, std140) uniform MaterialBlock { MaterialRecord material; };

// As textureGrad does, but with the level worked out here, so that every path and device filters alike; `absent` where
// the material has no such texture. No branch around the lookup: the software device has no jumps and would only keep a
// mask, which makes a dynamically chosen texture 1.5 times as dear (measured on the gather).
vec4 sample_surface(TextureUse use, SurfacePoint p, vec4 absent) {
  uint array = min(use.array, kTextureArrays - 1u);
  vec2 size = vec2(textureSize(scene_textures[array], 0).xy);
  vec2 dx = size * texture_gradient(use, p.uv0_gradient.xy, p.uv1_gradient.xy);
  vec2 dy = size * texture_gradient(use, p.uv0_gradient.zw, p.uv1_gradient.zw);
  vec2 seen_dx = size * texture_gradient(use, p.uv0_seen.xy, p.uv1_seen.xy);
  vec2 seen_dy = size * texture_gradient(use, p.uv0_seen.zw, p.uv1_seen.zw);
  float widest = max(max(dot(dx, dx), dot(dy, dy)), max(dot(seen_dx, seen_dx), dot(seen_dy, seen_dy)));
  float level = 0.5 * log2(clamp(widest, 1e-6, 1e12));
  vec3 where = vec3(texture_uv(use, p.uv0, p.uv1), float(use.layer_texcoord & 0xffffu));
  vec4 texel = textureLod(scene_textures[array], where, level);
  return use.array == kNone ? absent : texel;
}

// Linear, with alpha.
vec4 base_color(SurfacePoint p) {
  return material.base_color * p.color * sample_surface(material.base_color_texture, p, vec4(1.0));
}

// All that the material's textures say about a point.
struct MaterialPoint {
  vec4 base;       // linear, with alpha
  vec3 normal;     // world, unit
  float metallic, roughness, occlusion;
  vec3 emitted;
};

vec3 mapped_normal(SurfacePoint p) {
  vec3 m = sample_surface(material.normal_texture, p, vec4(0.5, 0.5, 1.0, 1.0)).xyz * 2.0 - 1.0;
  m.xy *= material.normal_scale;
  vec3 t = safe_normalize(p.tangent.xyz - p.normal * dot(p.normal, p.tangent.xyz), vec3(0.0));
  vec3 b = p.tangent.w * cross(p.normal, t);
  return safe_normalize(m.x * t + m.y * b + m.z * p.normal, p.normal);
}

MaterialPoint material_point(SurfacePoint p) {
  MaterialPoint m;
  m.base = base_color(p);
  m.normal = p.normal;
  if (kNormalMaps) m.normal = mapped_normal(p);
  m.metallic = material.emissive_metallic.a;
  m.roughness = material.roughness;
  if (kMetallicRoughnessMaps) {
    vec4 texel = sample_surface(material.metallic_roughness_texture, p, vec4(1.0));
    m.metallic *= texel.b;
    m.roughness *= texel.g;
  }
  m.occlusion = 1.0;
  if (kOcclusionMaps)
    m.occlusion = mix(1.0, sample_surface(material.occlusion_texture, p, vec4(1.0)).r, material.occlusion_strength);
  m.emitted = vec3(0.0);
  if (kEmissive)
    m.emitted = material.emissive_metallic.rgb * sample_surface(material.emissive_texture, p, vec4(1.0)).rgb;
  return m;
}

vec3 hemisphere(vec3 direction) { return mix(ambient_ground.rgb, ambient_sky.rgb, 0.5 * direction.y + 0.5); }

// Hemisphere light: irradiance / pi on the diffuse part, the mirror direction's radiance on the specular part.
vec3 ambient_light(Substance s, vec3 normal, vec3 v) {
  vec2 scale_bias = environment_scale_bias(clamp(dot(normal, v), 0.0, 1.0), s.roughness);
  vec3 specular = s.f0 * scale_bias.x + scale_bias.y;
  return hemisphere(normal) * s.diffuse + hemisphere(reflect(-v, normal)) * specular;
}

// Display-linear colour in [0, 1] of point `p` of material `m` seen from `eye` (relative to the instant's origin).
vec3 shade(SurfacePoint p, MaterialPoint m, vec3 eye) {
  if (kUnlit && (material.flags & kMaterialUnlit) != 0u) return clamp(m.base.rgb, 0.0, 1.0);
  vec3 v = safe_normalize(eye - p.position, p.normal);
  vec3 normal = m.normal, geometric = p.geometric_normal;
  if (kDoubleSided && (material.flags & kMaterialDoubleSided) != 0u && dot(geometric, v) < 0.0) {
    geometric = -geometric;
    normal = -normal;
  }
  Substance s = make_substance(m.base.rgb, m.metallic, m.roughness);
  vec3 radiance = direct_light(s, p.position, geometric, normal, v);
  radiance += ambient_light(s, normal, v) * m.occlusion + m.emitted;
  return tone_map(radiance * ambient_sky.a);
}

#endif
