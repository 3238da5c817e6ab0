// The reflectance model, falloffs and the tone curve: the shaders' own text, run as C++.
#include <gmock/gmock.h>

#include <random>

#include "shader_functions.h"

namespace tessera::shading::test {
namespace {

const vec3 kUp(0, 0, 1);

vec3 direction(float cosine, float azimuth) {
  const float sine = std::sqrt(std::max(0.0f, 1 - cosine * cosine));
  return vec3(sine * std::cos(azimuth), sine * std::sin(azimuth), cosine);
}

bool is_finite(const vec3& c) {
  return std::isfinite(c.x) && std::isfinite(c.y) && std::isfinite(c.z);
}

// Share of uniform white light from the upper hemisphere that comes out towards `v`. The lobe is integrated
// around half vectors (density of GGX itself), so that a narrow one is met.
double albedo(const Substance& s, const vec3& v) {
  constexpr int kSteps = 160;
  const double alpha2 = std::pow(double{s.roughness}, 4.0);
  double sum = 0;
  for (int i = 0; i < kSteps; ++i)
    for (int j = 0; j < kSteps; ++j) {
      const double x = (i + 0.5) / kSteps;
      const float cosine = static_cast<float>(std::sqrt((1 - x) / (1 + (alpha2 - 1) * x)));
      const vec3 h = direction(cosine, 6.2831853f * (static_cast<float>(j) + 0.5f) / kSteps);
      const vec3 l = 2 * dot(v, h) * h - v;
      const double density =
          ggx_distribution(cosine, s.roughness * s.roughness) * cosine / (4 * std::max(dot(v, h), 1e-6f));
      if (l.z > 0 && density > 0) sum += reflected(s, kUp, v, l).x / density;
    }
  return sum / (kSteps * kSteps);
}

TEST(Brdf, IsReciprocal) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> uniform(0.02f, 1.0f);
  for (int i = 0; i < 2000; ++i) {
    const Substance s = make_substance(vec3(uniform(random)), uniform(random), uniform(random));
    const vec3 l = direction(uniform(random), 6.28f * uniform(random));
    const vec3 v = direction(uniform(random), 6.28f * uniform(random));
    const float there = reflected(s, kUp, v, l).x / l.z, back = reflected(s, kUp, l, v).x / v.z;
    EXPECT_NEAR(there, back, 1e-3f * std::max(there, back));
  }
}

TEST(Brdf, SpecularNeverReturnsMoreThanItGot) {
  for (float roughness : {0.0f, 0.1f, 0.3f, 0.6f, 1.0f})
    for (float cosine : {0.1f, 0.5f, 0.9f, 1.0f}) {
      const double share = albedo(make_substance(vec3(1), 1, roughness), direction(cosine, 0.4f));
      EXPECT_LE(share, 1.02) << roughness << " " << cosine;
      EXPECT_GE(share, 0.3) << roughness << " " << cosine;  // single scattering loses the rest
    }
}

TEST(Brdf, SpecularAlbedoHasItsClosedForm) {
  // alpha = 1, normal incidence: the integral of cos / (1 + cos) = 1 - ln 2.
  EXPECT_NEAR(albedo(make_substance(vec3(1), 1, 1), kUp), 1 - std::log(2.0), 1e-3);
}

TEST(Brdf, RoughDielectricIsAlmostLambert) {
  const Substance s = make_substance(vec3(0.5f), 0, 1);
  EXPECT_NEAR(reflected(s, kUp, kUp, kUp).x, 0.96f * 0.5f / kPi, 0.02f);
}

TEST(Brdf, LightFromBehindGivesNothing) {
  const Substance s = make_substance(vec3(1), 0.5f, 0.2f);
  EXPECT_EQ(reflected(s, kUp, kUp, -kUp), vec3(0));
  EXPECT_EQ(reflected(s, kUp, kUp, normalize(vec3(1, 0, -1e-3f))), vec3(0));
}

TEST(Brdf, IsFiniteAtEveryLimit) {
  const vec3 directions[] = {
      kUp, -kUp, vec3(1, 0, 0), vec3(-1, 0, 0), direction(1e-6f, 0), direction(1e-3f, 3), vec3(0)};
  for (float roughness : {-1.0f, 0.0f, 1e-6f, 1.0f, 2.0f})
    for (float metallic : {-1.0f, 0.0f, 1.0f, 3.0f})
      for (const vec3& n : directions)
        for (const vec3& v : directions)
          for (const vec3& l : directions) {
            const vec3 f = reflected(make_substance(vec3(1), metallic, roughness), n, v, l);
            EXPECT_TRUE(is_finite(f) && f.x >= 0) << roughness << " " << metallic;
          }
}

TEST(Brdf, EnvironmentTermsStayInRange) {
  for (float n_v = 0; n_v <= 1; n_v += 0.05f)
    for (float roughness = 0; roughness <= 1; roughness += 0.05f) {
      const vec2 ab = environment_scale_bias(n_v, roughness);
      EXPECT_GE(ab.x + ab.y, 0.2f);
      EXPECT_LE(ab.x + ab.y, 1.05f);
    }
}

TEST(Falloff, FollowsTheInverseSquareWithinItsRange) {
  EXPECT_FLOAT_EQ(distance_falloff(4, 0), 0.25f);
  EXPECT_FLOAT_EQ(distance_falloff(4, 1.0f / 4), 0.25f * (1 - 1.0f / 16));
  EXPECT_FLOAT_EQ(distance_falloff(16, 1.0f / 4), 0);
  EXPECT_FLOAT_EQ(distance_falloff(1e12f, 1.0f / 4), 0);
  EXPECT_FLOAT_EQ(distance_falloff(0, 0), 1e4f);  // as from 1 cm
}

TEST(Falloff, ConeReachesFromInnerToOuterAngle) {
  const float inner = 0.3f, outer = 0.6f;
  const float scale = 1 / (std::cos(inner) - std::cos(outer)), offset = -std::cos(outer) * scale;
  EXPECT_NEAR(cone_falloff(std::cos(0.2f), scale, offset), 1, 1e-5f);
  EXPECT_NEAR(cone_falloff(std::cos(inner), scale, offset), 1, 1e-5f);
  EXPECT_NEAR(cone_falloff(0.5f * (std::cos(inner) + std::cos(outer)), scale, offset), 0.25f, 1e-5f);
  EXPECT_NEAR(cone_falloff(std::cos(outer), scale, offset), 0, 1e-5f);
  EXPECT_EQ(cone_falloff(-1, scale, offset), 0);
}

TEST(ToneMap, IsMonotonicAndStaysInRange) {
  float last = -1;
  for (float x = 1e-6f; x < 2e6f; x *= 1.3f) {
    const vec3 c = tone_map(vec3(x));
    EXPECT_GE(c.x, last);
    EXPECT_LE(c.x, 1);
    last = c.x;
  }
  EXPECT_NEAR(last, 1, 1e-4f);
}

TEST(ToneMap, LeavesHueAloneBelowTheKneeAndMapsNaNToBlack) {
  const vec3 c = tone_map(vec3(0.5f, 0.3f, 0.2f));
  EXPECT_NEAR(c.x - c.y, 0.2f, 1e-6f);
  EXPECT_NEAR(c.y - c.z, 0.1f, 1e-6f);
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  EXPECT_EQ(tone_map(vec3(nan, -1, nan)), vec3(0));
  EXPECT_TRUE(is_finite(tone_map(vec3(inf, 1e6f, 1e-6f))));
  EXPECT_GT(tone_map(vec3(inf, 1e6f, 1e-6f)).x, 0.99f);
}

TEST(Srgb, RoundTripsEveryByte) {
  for (int i = 0; i < 256; ++i)
    EXPECT_EQ(std::lround(255 * srgb_encode(srgb_decode(static_cast<float>(i) / 255))), i);
}

}  // namespace
}  // namespace tessera::shading::test
