// The one material of every pass: what colour a surface point shows to an eye. Reads: sets 0, 1, 2.
#ifndef TESSERA_MATERIAL_GLSL
#define TESSERA_MATERIAL_GLSL

#include "scene/shaders/scene.glsl"
#include "shading/shaders/color.glsl"
#include "shading/shaders/lighting.glsl"
#include "shading/shaders/surface.glsl"

// As textureGrad does, but with the level worked out here: every path and device filters alike, and Mesa 22.3's compiler
// aborts on textureGrad in compute shaders ("Cannot emit physreg copy instruction", LLVM 15 with AVX-512).
vec4 sample_surface(TextureUse use, SurfacePoint p) {
  vec2 size = vec2(textureSize(scene_textures[use.array], 0).xy);
  vec2 dx = size * texture_gradient(use, p.uv0_gradient.xy, p.uv1_gradient.xy);
  vec2 dy = size * texture_gradient(use, p.uv0_gradient.zw, p.uv1_gradient.zw);
  float level = 0.5 * log2(clamp(max(dot(dx, dx), dot(dy, dy)), 1e-6, 1e12));
  vec3 where = vec3(texture_uv(use, p.uv0, p.uv1), float(use.layer_texcoord & 0xffffu));
  return textureLod(scene_textures[use.array], where, level);
}

// Linear, with alpha.
vec4 base_color(SurfacePoint p) {
  vec4 color = materials[p.material].base_color * p.color;
  TextureUse use = materials[p.material].base_color_texture;
  if (use.array != kNone) color *= sample_surface(use, p);
  return color;
}

bool is_cut_away(SurfacePoint p) { return base_color(p).a < materials[p.material].alpha_cutoff; }

vec3 mapped_normal(SurfacePoint p) {
  TextureUse use = materials[p.material].normal_texture;
  if (!kNormalMaps || use.array == kNone) return p.normal;
  vec3 m = sample_surface(use, p).xyz * 2.0 - 1.0;
  m.xy *= materials[p.material].normal_scale;
  vec3 t = safe_normalize(p.tangent.xyz - p.normal * dot(p.normal, p.tangent.xyz), vec3(0.0));
  vec3 b = p.tangent.w * cross(p.normal, t);
  return safe_normalize(m.x * t + m.y * b + m.z * p.normal, p.normal);
}

Substance substance(SurfacePoint p, vec3 base) {
  float metallic = materials[p.material].emissive_metallic.a;
  float roughness = materials[p.material].roughness;
  TextureUse use = materials[p.material].metallic_roughness_texture;
  if (kMetallicRoughnessMaps && use.array != kNone) {
    vec4 m = sample_surface(use, p);
    metallic *= m.b;
    roughness *= m.g;
  }
  return make_substance(base, metallic, roughness);
}

vec3 emitted(SurfacePoint p) {
  vec3 e = materials[p.material].emissive_metallic.rgb;
  TextureUse use = materials[p.material].emissive_texture;
  return use.array == kNone ? e : e * sample_surface(use, p).rgb;
}

float occlusion(SurfacePoint p) {
  TextureUse use = materials[p.material].occlusion_texture;
  if (!kOcclusionMaps || use.array == kNone) return 1.0;
  return mix(1.0, sample_surface(use, p).r, materials[p.material].occlusion_strength);
}

vec3 hemisphere(vec3 direction) { return mix(ambient_ground.rgb, ambient_sky.rgb, 0.5 * direction.y + 0.5); }

// Hemisphere light: irradiance / pi on the diffuse part, the mirror direction's radiance on the specular part.
vec3 ambient_light(Substance s, vec3 normal, vec3 v) {
  vec2 scale_bias = environment_scale_bias(clamp(dot(normal, v), 0.0, 1.0), s.roughness);
  vec3 specular = s.f0 * scale_bias.x + scale_bias.y;
  return hemisphere(normal) * s.diffuse + hemisphere(reflect(-v, normal)) * specular;
}

// Display-linear colour in [0, 1] of point `p` seen from `eye` (relative to the instant's origin); `base` = base_color(p).
vec3 shade(SurfacePoint p, vec3 base, vec3 eye) {
  uint flags = materials[p.material].flags;
  if (kUnlit && (flags & kMaterialUnlit) != 0u) return clamp(base, 0.0, 1.0);
  vec3 v = safe_normalize(eye - p.position, p.normal);
  vec3 normal = mapped_normal(p);
  vec3 geometric = p.geometric_normal;
  if (kDoubleSided && (flags & kMaterialDoubleSided) != 0u && dot(geometric, v) < 0.0) {
    geometric = -geometric;
    normal = -normal;
  }
  Substance s = substance(p, base);
  vec3 radiance = direct_light(s, p.position, geometric, normal, v) + ambient_light(s, normal, v) * occlusion(p);
  if (kEmissive) radiance += emitted(p);
  return tone_map(radiance * ambient_sky.a);
}

#endif
