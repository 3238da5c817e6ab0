// Samples that are even in the screen of a reference view (TSS eq. 5): barycentrics s of the even grid, lambda of the surface.
// w = a corner's clip-space w in that view; `ratios` = (w1 / w0, w2 / w0), 1/64..64, as ratio_from_code() gives them.
#ifndef TESSERA_ADDRESSING_PERSPECTIVE_GLSL
#define TESSERA_ADDRESSING_PERSPECTIVE_GLSL

#include "atlas/addressing/language.glsl"

// Where a sample lies: lambda_i ~ s_i / w_i. For s in the triangle; outside the sum may vanish. As one corner's w goes to 0, all
// samples that it has a part in go to it: hence the limits of the ratios.
INLINE vec3 to_surface(vec3 s, vec2 ratios) {
  vec3 p = vec3(s.x * (ratios.x * ratios.y), s.y * ratios.y, s.z * ratios.x);
  return p / (p.x + p.y + p.z);
}

// Where to read: s_i ~ lambda_i w_i, the inverse. For lambda in the triangle. As one corner's w goes to 0, its s does so for all
// points but the corner itself.
INLINE vec3 to_grid(vec3 lambda, vec2 ratios) {
  vec3 p = vec3(lambda.x, lambda.y * ratios.x, lambda.z * ratios.y);
  return p / (p.x + p.y + p.z);
}

// A ratio as it travels: 21 codes an octave from 0 = 1/64 over 126 = 1 (exactly) to 252 = 64.
const int kRatioCodesPerOctave = 21;
const int kRatioCodeOne = 126;
const int kRatioCodeMax = 252;

// The nearest code: off by a factor of at most 2^(1/42), 1.7 %. What is no number counts as 1/64.
INLINE int ratio_code(float ratio) {
  float limited = ratio > 1.0f / 64.0f ? min(ratio, 64.0f) : 1.0f / 64.0f;
  return int(floor(log2(limited) * float(kRatioCodesPerOctave) + 0.5f)) + kRatioCodeOne;
}

// Any code; those beyond 252 count as it. Multiplies only, since these round the same everywhere, as exp2 does not: server and
// client get the same bits, so samples do not swim.
INLINE float ratio_from_code(int code) {
  int limited = clamp(code, 0, kRatioCodeMax);
  int octave = limited / kRatioCodesPerOctave;
  int step = limited % kRatioCodesPerOctave;
  float ratio = float(1 << octave) * (1.0f / 64.0f);
  if ((step & 1) != 0) ratio *= 1.03355778f;  // 2^(1/21), and so on
  if ((step & 2) != 0) ratio *= 1.06824169f;
  if ((step & 4) != 0) ratio *= 1.14114031f;
  if ((step & 8) != 0) ratio *= 1.30220129f;
  if ((step & 16) != 0) ratio *= 1.69572798f;
  return ratio;
}

#endif
