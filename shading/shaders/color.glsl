// From radiance to what a screen shows. Also compiles as C++ over glm, like brdf.glsl.
#ifndef TESSERA_COLOR_GLSL
#define TESSERA_COLOR_GLSL

float finite_radiance(float c) { return c > 0.0f ? min(c, 1e6f) : 0.0f; }  // NaN and negative become 0

// Khronos PBR Neutral tone mapper: colours below 0.8 keep their hue and contrast, brighter ones approach white
// smoothly. Radiance in [0, 1e6] (else clamped) to display-linear [0, 1].
vec3 tone_map(vec3 radiance) {
  const float kKnee = 0.76f;          // 0.8 less the reflection of a dielectric, 0.04
  const float kDesaturation = 0.15f;
  vec3 c = vec3(finite_radiance(radiance.x), finite_radiance(radiance.y), finite_radiance(radiance.z));
  float low = min(c.x, min(c.y, c.z));
  c = c - vec3(low < 0.08f ? low - 6.25f * low * low : 0.04f);
  float peak = max(c.x, max(c.y, c.z));
  if (peak < kKnee) return c;
  float room = 1.0f - kKnee;
  float new_peak = 1.0f - room * room / (peak + room - kKnee);
  float to_white = 1.0f - 1.0f / (kDesaturation * (peak - new_peak) + 1.0f);
  return mix(c * (new_peak / peak), vec3(new_peak), vec3(to_white));
}

float srgb_encode(float c) {
  return c <= 0.0031308f ? 12.92f * c : 1.055f * pow(c, 1.0f / 2.4f) - 0.055f;
}
float srgb_decode(float c) { return c <= 0.04045f ? c / 12.92f : pow((c + 0.055f) / 1.055f, 2.4f); }

vec3 srgb_encode_color(vec3 c) { return vec3(srgb_encode(c.x), srgb_encode(c.y), srgb_encode(c.z)); }

#endif
