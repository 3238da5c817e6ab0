// The forward renderer, and through it materials, lights and shadows.
#include <gmock/gmock.h>

#include "scene_builder.h"
#include "shader_functions.h"
#include "test_world.h"

namespace tessera::shading::test {
namespace {

using scene::LightType;

using Rgb = std::array<int, 3>;

Rgb pixel(const ReferenceImage& image, uint32_t x, uint32_t y) {
  const uint8_t* p = image.color.at(x, y);
  return {p[0], p[1], p[2]};
}
Rgb center(const ReferenceImage& image) {
  return pixel(image, image.color.width / 2, image.color.height / 2);
}
int sum(const Rgb& c) {
  return c[0] + c[1] + c[2];
}

Rgb encoded(const vec3& linear) {
  const vec3 c = 255.0f * srgb_encode_color(linear);
  return {static_cast<int>(std::lround(c.x)), static_cast<int>(std::lround(c.y)),
          static_cast<int>(std::lround(c.z))};
}

void expect_near(const Rgb& a, const Rgb& b, int tolerance) {
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(a[i], b[i], tolerance) << "channel " << i;
}

const Rgb kSky{kBackground[0], kBackground[1], kBackground[2]};

scene::Material matte(vec4 color = vec4(1), bool double_sided = false) {
  return {.base_color = color, .metallic = 0, .roughness = 1, .double_sided = double_sided};
}

// A 2 m square around the origin that faces +z.
uint32_t facing_square(SceneBuilder& b, uint32_t cells = 1) {
  return b.rectangle({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, cells);
}

scene::Light sun(float intensity) {
  return {.type = LightType::directional, .intensity = intensity};
}

const dvec3 kEye(0, 0, 3);

TEST(Reference, UnlitIsExact) {
  SceneBuilder b;
  scene::Material m = matte(vec4(0.25f, 0.5f, 0.75f, 1));
  m.unlit = true;
  b.instance(facing_square(b), b.material(m));
  b.light(sun(10), {}, {0, 0, -1});
  expect_near(center(render(make_world(b.build()), look(kEye, {}))), encoded({0.25f, 0.5f, 0.75f}), 1);
}

TEST(Reference, EmissionPassesTheToneCurve) {
  SceneBuilder b;
  scene::Material m = matte(vec4(0, 0, 0, 1));
  m.emissive = vec3(0.3f, 4, 0.1f);
  b.instance(facing_square(b), b.material(m));
  const auto image = render(make_world(b.build(), no_ambient()), look(kEye, {}));
  expect_near(center(image), encoded(tone_map(vec3(0.3f, 4, 0.1f))), 1);
}

TEST(Reference, SunOnAWhiteWallIsAsTheModelSays) {
  SceneBuilder b;
  b.instance(facing_square(b), b.material(matte()));
  const dvec3 down = glm::normalize(dvec3(0, -1, -1));
  b.light(sun(3.14159265f), {}, down);
  const auto image = render(make_world(b.build(), no_ambient()), look(kEye, {}));
  const vec3 n(0, 0, 1);
  const vec3 light = kPi * reflected(make_substance(vec3(1), 0, 1), n, n, vec3(-down));
  expect_near(center(image), encoded(tone_map(light)), 3);
}

TEST(Reference, PointLightFollowsItsFalloff) {
  for (const float range : {0.0f, 3.0f}) {
    SceneBuilder b;
    b.instance(facing_square(b), b.material(matte()));
    b.light({.type = LightType::point, .intensity = 5, .range = range}, {0, 0, 2}, {0, 0, -1});
    const vec3 n(0, 0, 1);
    const vec3 light = 5 * distance_falloff(4, range > 0 ? 1 / range : 0) *
                       reflected(make_substance(vec3(1), 0, 1), n, n, n);
    expect_near(center(render(make_world(b.build(), no_ambient()), look(kEye, {}))), encoded(tone_map(light)),
                3);
  }
}

TEST(Reference, TheOriginChangesNothing) {
  SceneBuilder b;
  b.instance(facing_square(b), b.material(matte()));
  b.light({.type = LightType::point, .intensity = 5, .range = 6}, {1, 1, 1}, {0, 0, -1});
  b.light(sun(1), {}, {0, -1, -1});
  const auto scene = b.build();
  const auto a = render(make_world(scene), look(kEye, {}));
  const auto c = render(make_world(scene, {}, {100, -200, 50}), look(kEye, {}));
  for (uint32_t i = 0; i < 32; ++i) expect_near(pixel(a, i, i), pixel(c, i, i), 2);
}

TEST(Reference, DoubleSidedShowsBothSidesLitFromTheirOwn) {
  for (const bool double_sided : {true, false})
    for (const double side : {1.0, -1.0}) {
      SceneBuilder b;
      b.instance(facing_square(b), b.material(matte(vec4(1), double_sided)));
      b.light(sun(3), {}, {0, 0, -side});  // from the eye's side
      const auto image = render(make_world(b.build(), no_ambient()), look({0, 0, 3 * side}, {}));
      if (double_sided || side > 0) {
        EXPECT_GT(sum(center(image)), 300);
      } else {
        EXPECT_EQ(center(image), kSky);
      }
    }
}

TEST(Reference, DoubleSidedIsDarkWhenLitFromBehind) {
  for (const double side : {1.0, -1.0}) {
    SceneBuilder b;
    b.instance(facing_square(b), b.material(matte(vec4(1), true)));
    b.light(sun(3), {}, {0, 0, side});
    EXPECT_LT(sum(center(render(make_world(b.build(), no_ambient()), look({0, 0, 3 * side}, {})))), 10);
  }
}

TEST(Reference, MirroredInstanceLooksAlike) {
  Rgb colors[2];
  for (const double mirror : {1.0, -1.0}) {
    SceneBuilder b;
    scene::Node node;
    node.scale = {mirror, 1, 1};
    b.instance(facing_square(b), b.material(matte(vec4(0.5f))), node);
    b.light(sun(3), {}, {0.3, -0.5, -1});
    colors[mirror < 0] = center(render(make_world(b.build()), look(kEye, {})));
  }
  EXPECT_NE(colors[1], kSky);
  expect_near(colors[0], colors[1], 1);
}

TEST(Reference, AlphaMaskCutsHoles) {
  SceneBuilder b;
  scene::Material m = matte();
  m.alpha_mode = scene::AlphaMode::mask;
  m.base_color_texture.texture = b.texture(wavy_texture(64, true));
  b.instance(facing_square(b), b.material(m));
  const auto image = render(make_world(b.build()), look(kEye, {}), {.ids = true});
  const auto at = [&](uint32_t x) { return pixel(image, x, 16); };
  EXPECT_EQ(at(12), kSky);
  EXPECT_NE(at(20), kSky);
  EXPECT_EQ(image.triangle_plus_one[16 * 32 + 12], 0u);
  EXPECT_NE(image.triangle_plus_one[16 * 32 + 20], 0u);
}

// A floor under a small roof: dark below the roof, light beside it.
void expect_shadow(const scene::Light& light, const dvec3& position, const dvec3& direction) {
  SceneBuilder b;
  const uint32_t white = b.material(matte(vec4(1), true));
  b.instance(b.rectangle({-4, 0, 4}, {8, 0, 0}, {0, 0, -8}, 4), white);
  b.instance(b.rectangle({-1, 1, 1}, {2, 0, 0}, {0, 0, -2}), white);
  b.light(light, position, direction);
  const World world = make_world(b.build(), no_ambient());
  EXPECT_EQ(world.lighting->shadow_maps(), 1u);
  // Low enough to see the floor under the roof.
  const auto below = render(world, look({0, 0.5, 3}, {0, 0, 0.0}));
  EXPECT_LT(sum(center(below)), 20);
  const auto beside = render(world, look({2.2, 3, 3}, {2.2, 0, 0.0}));
  EXPECT_GT(sum(center(beside)), 150);
}

TEST(Shadows, SunIsBlockedByARoof) {
  expect_shadow(sun(5), {}, {0.05, -1, 0});
}

TEST(Shadows, SpotIsBlockedByARoof) {
  expect_shadow({.type = LightType::spot, .intensity = 300, .inner_cone_rad = 0.8f, .outer_cone_rad = 0.9f},
                {0, 4, 0}, {0, -1, 0});
}

TEST(Shadows, FlatGroundDoesNotShadowItself) {
  for (const dvec3 direction : {dvec3(0, -1, 0), dvec3(1, -1, 0), dvec3(1, -0.2, 0.3)}) {
    SceneBuilder b;
    b.instance(b.rectangle({-4, 0, 4}, {8, 0, 0}, {0, 0, -8}, 4), b.material(matte(vec4(0.5f))));
    b.light(sun(3), {}, direction);
    const auto image = render(make_world(b.build(), no_ambient()), look({0, 3, 1}, {0, 0, 0}));
    const vec3 n(0, 1, 0), l(-glm::normalize(direction));
    const vec3 lit = 3.0f * 0.5f * std::max(dot(n, l), 0.0f) * 0.96f / kPi * vec3(1);
    for (uint32_t y = 4; y < 28; ++y)
      for (uint32_t x = 4; x < 28; ++x) EXPECT_GT(pixel(image, x, y)[0], encoded(tone_map(0.7f * lit))[0]);
  }
}

TEST(Lighting, ASceneWithoutLightsDrawsNoShadows) {
  SceneBuilder b;
  b.instance(facing_square(b), b.material(matte()));
  const auto scene = b.build();
  const uint64_t draws = device().draws_recorded(), dispatches = device().dispatches_recorded();
  const World world = make_world(scene);
  EXPECT_EQ(world.lighting->shadow_maps(), 0u);
  EXPECT_EQ(device().draws_recorded() - draws, 0u);
  EXPECT_EQ(device().dispatches_recorded() - dispatches, 0u);
}

TEST(Lighting, PointLightsAloneDrawNoShadows) {
  SceneBuilder b;
  b.instance(facing_square(b), b.material(matte()));
  b.light({.type = LightType::point, .intensity = 5}, {0, 0, 2}, {0, 0, -1});
  const auto scene = b.build();
  const uint64_t draws = device().draws_recorded();
  EXPECT_EQ(make_world(scene).lighting->shadow_maps(), 0u);
  EXPECT_EQ(device().draws_recorded() - draws, 0u);
}

TEST(Lighting, ShadowMapsAreDrawnAgainOnlyWhenSomethingMoved) {
  for (const bool animated : {false, true}) {
    SceneBuilder b;
    b.instance(facing_square(b), b.material(matte()));
    b.light(sun(1), {}, {0, -1, -1});
    if (animated) {
      b.scene().animation_length_s = 1;
      b.scene().nodes[0].moves = true;
      b.scene().animations.push_back({.node = 0,
                                      .path = scene::AnimationPath::translation,
                                      .interpolation = scene::Interpolation::linear,
                                      .times_s = {0, 1},
                                      .values = {vec4(0), vec4(1, 0, 0, 0)}});
    }
    const World world = make_world(b.build());
    const uint64_t drawn = device().draws_recorded();
    world.instant->set(0, {1, 2, 3});
    ASSERT_TRUE(world.lighting->update(*world.instant).ok());
    EXPECT_EQ(device().draws_recorded(), drawn);
    world.instant->set(kNsPerSecond / 2, {});
    ASSERT_TRUE(world.lighting->update(*world.instant).ok());
    EXPECT_EQ(device().draws_recorded() > drawn, animated);
  }
}

TEST(Reference, IdsDepthAndCoverageDescribeTheSquare) {
  SceneBuilder b;
  b.instance(facing_square(b), b.material(matte()), node_towards({5, 0, 0}, {0, 0, -1}));
  b.instance(0, 0);
  const auto image = render(make_world(b.build()), look(kEye, {}, 33), {.ids = true, .depth = true});
  const size_t middle = 16 * 33 + 16;
  EXPECT_THAT(image.triangle_plus_one[middle], testing::AnyOf(3u, 4u));  // the second instance
  EXPECT_NEAR(image.depth[middle], 3, 1e-4);
  EXPECT_EQ(image.covered[middle], 1);
  EXPECT_EQ(image.triangle_plus_one[0], 0u);
  EXPECT_EQ(image.depth[0], std::numeric_limits<float>::infinity());
  EXPECT_EQ(image.covered[0], 0);
  EXPECT_EQ(pixel(image, 0, 0), kSky);
  for (size_t i = 0; i < image.covered.size(); ++i)
    if (image.covered[i]) {
      EXPECT_NE(image.triangle_plus_one[i], 0u);
    }
}

TEST(Reference, NothingOutsideTheViewIsDrawn) {
  SceneBuilder b;
  b.instance(facing_square(b, 16), b.material(matte()));
  const World world = make_world(b.build());
  const uint64_t draws = device().draws_recorded();
  EXPECT_EQ(center(render(world, look(kEye, {0, 0, 9}))), kSky);
  EXPECT_EQ(device().draws_recorded(), draws);
}

TEST(Reference, RefusesImpossibleRequests) {
  SceneBuilder b;
  b.instance(facing_square(b), b.material(matte()));
  const World world = make_world(b.build());
  const auto renderer = ReferenceRenderer::create(device(), *world.gpu_scene, *world.lighting);
  ASSERT_TRUE(renderer.ok());
  EXPECT_EQ((*renderer)->render(*world.instant, look(kEye, {}, 0), {}).status().code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ((*renderer)->render(*world.instant, look(kEye, {}), {.samples = 3}).status().code(),
            absl::StatusCode::kInvalidArgument);
}

// Extremes must come out as plain colours: bright where light abounds, dark where it lacks. NaN would be
// black or arbitrary.
struct Extreme {
  float roughness, metallic, intensity;
  dvec3 light;
  bool zero_normals;
};

class Stability : public testing::TestWithParam<Extreme> {};

TEST_P(Stability, GivesABrightPixel) {
  const Extreme e = GetParam();
  SceneBuilder b;
  scene::Material m = matte(vec4(0.8f, 0.8f, 0.8f, 1));
  m.roughness = e.roughness, m.metallic = e.metallic;
  b.instance(facing_square(b), b.material(m));
  if (e.zero_normals)
    for (scene::Vertex& v : b.scene().geometries[0].vertices) v.normal = vec3(0);
  b.light({.type = LightType::point, .intensity = e.intensity}, e.light, {0, 0, -1});
  b.light({.type = LightType::point, .intensity = 1e-6f}, {1, 0, 1}, {0, 0, -1});
  const auto image = render(make_world(b.build(), no_ambient()), look(kEye, {}, 33));
  EXPECT_GT(sum(center(image)), 400);
}

INSTANTIATE_TEST_SUITE_P(
    Extremes, Stability,
    testing::Values(Extreme{0, 0, 50, {0, 0, 2}, false}, Extreme{1, 0, 50, {0, 0, 2}, false},
                    Extreme{0, 1, 50, {0, 0, 2}, false}, Extreme{1, 1, 50, {0, 0, 2}, false},
                    Extreme{0.5f, 0, 1e6f, {0, 0, 1}, false}, Extreme{0.5f, 0, 1e6f, {0, 0, 1e-3}, false},
                    Extreme{0.5f, 0, 1e30f, {0, 0, 1}, false}, Extreme{0.5f, 0, 1000, {0, 0, 1}, true}));

}  // namespace
}  // namespace tessera::shading::test
