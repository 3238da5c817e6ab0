// The metallic-roughness reflectance model of glTF 2.0 (appendix B): Lambert under a GGX microfacet layer.
// Also compiles as C++ over glm (f suffixes, no swizzles, no out parameters). Directions are unit vectors that point
// away from the surface; every result is finite for any roughness in [0, 1] and any directions.
#ifndef TESSERA_BRDF_GLSL
#define TESSERA_BRDF_GLSL

const float kPi = 3.14159265f;
// A perfect mirror would show each light as one infinitely bright point. 0.045² keeps 1/alpha² far inside float.
const float kMinRoughness = 0.045f;
const float kMinCosine = 1e-4f;  // grazing angles

struct Substance {
  vec3 diffuse;  // albedo of the Lambert part
  vec3 f0;       // reflectance at normal incidence
  float roughness;
};

Substance make_substance(vec3 base_color, float metallic, float roughness) {
  Substance s;
  float m = clamp(metallic, 0.0f, 1.0f);
  s.diffuse = base_color * (1.0f - m);
  s.f0 = mix(vec3(0.04f), base_color, vec3(m));
  s.roughness = clamp(roughness, kMinRoughness, 1.0f);
  return s;
}

// The zero vector has no direction: `fallback` instead.
vec3 safe_normalize(vec3 v, vec3 fallback) {
  float d = dot(v, v);
  return d > 1e-30f && d < 1e30f ? v * inversesqrt(d) : fallback;
}

// D, Trowbridge-Reitz; alpha = roughness².
float ggx_distribution(float n_h, float alpha) {
  float a2 = alpha * alpha;
  float t = 1.0f - n_h * n_h * (1.0f - a2);
  return a2 / (kPi * t * t);
}

// G / (4 n_l n_v), height-correlated Smith.
float smith_visibility(float n_l, float n_v, float alpha) {
  float a2 = alpha * alpha;
  float masking = n_l * sqrt(n_v * n_v * (1.0f - a2) + a2);
  float shadowing = n_v * sqrt(n_l * n_l * (1.0f - a2) + a2);
  return 0.5f / (masking + shadowing);
}

vec3 schlick_fresnel(vec3 f0, float v_h) {
  float m = 1.0f - v_h;
  float m2 = m * m;
  return f0 + (vec3(1.0f) - f0) * (m2 * m2 * m);
}

// f(l, v) * cos(n, l); zero for light from behind.
vec3 reflected(Substance s, vec3 n, vec3 v, vec3 l) {
  float n_l = dot(n, l);
  float n_v = max(dot(n, v), kMinCosine);
  vec3 h = safe_normalize(l + v, n);
  float alpha = s.roughness * s.roughness;
  vec3 fresnel = schlick_fresnel(s.f0, clamp(dot(v, h), 0.0f, 1.0f));
  float specular = ggx_distribution(clamp(dot(n, h), 0.0f, 1.0f), alpha) *
                   smith_visibility(max(n_l, kMinCosine), n_v, alpha);
  vec3 f = (vec3(1.0f) - fresnel) * s.diffuse * (1.0f / kPi) + fresnel * specular;
  return f * max(n_l, 0.0f);
}

// Scale and bias of f0 that integrate the specular lobe over uniform light: Karis' fit ("Physically Based Shading on
// Mobile", 2014) to the split-sum table.
vec2 environment_scale_bias(float n_v, float roughness) {
  vec4 r = roughness * vec4(-1.0f, -0.0275f, -0.572f, 0.022f) + vec4(1.0f, 0.0425f, 1.04f, -0.04f);
  float a = min(r.x * r.x, exp2(-9.28f * n_v)) * r.x + r.y;
  return vec2(-1.04f * a + r.z, 1.04f * a + r.w);
}

// KHR_lights_punctual: inverse square, windowed by the range. `inverse_range` 0 = unlimited. A light may lie on the
// surface: closer than 1 cm it shines as from 1 cm.
float distance_falloff(float distance2, float inverse_range) {
  float q = distance2 * inverse_range * inverse_range;
  return clamp(1.0f - q * q, 0.0f, 1.0f) / max(distance2, 1e-4f);
}

// KHR_lights_punctual: `cosine` between the spot's axis and the ray; scale and offset from the two cone angles.
float cone_falloff(float cosine, float scale, float offset) {
  float t = clamp(cosine * scale + offset, 0.0f, 1.0f);
  return t * t;
}

#endif
