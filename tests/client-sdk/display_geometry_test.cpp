// Where surfaces appear: winding, depth, stereo, large coordinates.
#include <gtest/gtest.h>

#include <array>
#include <cstdlib>
#include <optional>

#include "display_fixture.h"

namespace tessera::client {
namespace {

using namespace test;

constexpr uint32_t kSide = 64;
constexpr Rgb kGreen{0, 200, 0}, kRed{200, 0, 0};

Rgb center_of(const SceneBuilder& scene, Display& display, const View& view = square_view(kSide)) {
  return pixel(picture_of(display, scene.state(), ramp_atlas(), view), kSide / 2 + 3, kSide / 2 + 5);
}

// A rectangle seen from its front or its back, by an object that mirrors it or not.
bool is_visible(Display& display, bool from_front, const ObjectFlags& flags) {
  SceneBuilder scene;
  const uint32_t object = scene.object(flags, dvec3(0), vec3(flags.mirrored ? -1 : 1, 1, 1));
  // The transform mirrors x, which turns the front around: the server says so by the flag.
  scene.color(scene.rectangle(object, -1, -1, 1, 1, -1), kGreen);
  View view = square_view(kSide);
  if (!from_front) {
    view.pose.position = dvec3(0, 0, -2);
    view.pose.orientation = glm::angleAxis(3.14159265358979, dvec3(0, 1, 0));
  }
  return near(center_of(scene, display, view), kGreen, 0);
}

TEST(Geometry, OnlyFrontFacesOfSingleSidedObjectsAreDrawn) {
  auto display = make_display(kSide);
  for (bool masked : {false, true}) {
    for (bool mirrored : {false, true}) {
      EXPECT_TRUE(is_visible(*display, true, {.mirrored = mirrored, .masked = masked})) << mirrored << masked;
      EXPECT_FALSE(is_visible(*display, false, {.mirrored = mirrored, .masked = masked}))
          << mirrored << masked;
      EXPECT_TRUE(is_visible(*display, true, {.mirrored = mirrored, .double_sided = true, .masked = masked}));
      EXPECT_TRUE(
          is_visible(*display, false, {.mirrored = mirrored, .double_sided = true, .masked = masked}));
    }
  }
}

// The reversed order of corners must take the block's coordinates along.
TEST(Geometry, MirroredObjectsShowTheMirroredPicture) {
  auto display = make_display(kSide);
  for (size_t corners : {3u, 4u, 5u}) {
    const std::vector<vec3> all = {{-1, -1, -1},
                                   {1, -1, -1},
                                   corners == 5 ? vec3(0, 1, -1) : vec3(-1, 1, -1),
                                   corners == 5 ? vec3(-1, 1, -1) : vec3(1, 1, -1),
                                   {1, 1, -1}};
    const std::vector<vec3> used(all.begin(), all.begin() + static_cast<ptrdiff_t>(corners));
    std::array<Image8, 2> images;
    for (bool mirrored : {false, true}) {
      SceneBuilder scene;
      scene.block(
          scene.patch(scene.object({.mirrored = mirrored}, dvec3(0), vec3(mirrored ? -1 : 1, 1, 1)), used), 4,
          4, 4, 3);
      images[mirrored] = picture_of(*display, scene.state(), ramp_atlas(), square_view(kSide));
    }
    size_t differing = 0;
    for (uint32_t y = 0; y < kSide; ++y) {
      for (uint32_t x = 0; x < kSide; ++x) {
        differing += near(pixel(images[0], x, y), pixel(images[1], kSide - 1 - x, y), 2) ? 0 : 1;
      }
    }
    EXPECT_LE(differing, 2 * kSide) << "the edges' samples are not symmetric";
    EXPECT_FALSE(near(pixel(images[0], 4, kSide - 4), pixel(images[0], kSide - 12, kSide - 4), 20))
        << "the test itself";
  }
}

// A screen of strips about a pixel thin, at every slant: nearly every pixel is shared. Each strip shows its
// block's ramp along it, so that a pixel's red tells where it was sampled.
TEST(Geometry, PixelsSharedByThinPatchesAreSampledAtTheirCentres) {
  constexpr float kHalfLength = 1.5f, kRise = 0.034f, kTwoPi = 6.2831853f;
  constexpr int kTurns = 12;
  auto display = make_display(kSide);
  for (int turn = 0; turn < kTurns; ++turn) {
    const float angle = kTwoPi * (static_cast<float>(turn) + 0.3f) / kTurns;
    const vec2 along(std::cos(angle), std::sin(angle)), across(-along.y, along.x);
    const auto at = [&](float a, float b) { return vec3(a * along + b * across, -1); };
    SceneBuilder scene;
    const uint32_t object = scene.object();
    for (float b = -kHalfLength; b < kHalfLength; b += kRise) {
      scene.block(scene.patch(object, {at(-kHalfLength, b), at(kHalfLength, b), at(-kHalfLength, b + kRise),
                                       at(kHalfLength, b + kRise)}),
                  0, 0, 5, 1);
    }
    const Image8 image = picture_of(*display, scene.state(), ramp_atlas(), square_view(kSide));
    for (uint32_t y = 2; y < kSide - 2; ++y) {
      for (uint32_t x = 2; x < kSide - 2; ++x) {
        const vec2 center = (vec2(x, y) + 0.5f) * (2.0f / kSide) - 1.0f;
        const float position = glm::dot(vec2(center.x, -center.y), along);
        // 2.6 levels a pixel; 0.5 by rounding.
        ASSERT_NEAR(pixel(image, x, y).r, 248 * (position + kHalfLength) / (2 * kHalfLength), 0.75)
            << x << "," << y << " turn " << turn;
      }
    }
  }
}

// The same for thinner strips of which one edge was four times as far as the other from the eye that they
// were placed for: pixels' centres lie beyond its horizon, where interpolated distances vanish or are
// negative.
TEST(Geometry, PixelsBesideStripsThatWerePlacedAtASlantKeepTheirPlaceAlongThem) {
  constexpr float kHalfLength = 1.5f, kRise = 0.008f;
  constexpr int8_t kFourTimes = 42;
  auto display = make_display(kSide);
  for (const bool upper_is_far : {false, true}) {
    SceneBuilder scene;
    const uint32_t object = scene.object();
    const int8_t code = upper_is_far ? kFourTimes : -kFourTimes;
    for (float y = -kHalfLength; y < kHalfLength; y += kRise) {
      scene.block(scene.rectangle(object, -kHalfLength, y, kHalfLength, y + kRise, -1), 0, 0, 5, 1);
      scene.meta().placements.back().spacing = {0, code, code, 0};  // of corners 1, 2, 3
    }
    const Image8 image = picture_of(*display, scene.state(), ramp_atlas(), square_view(kSide));
    for (uint32_t y = 2; y < kSide - 2; ++y) {
      for (uint32_t x = 2; x < kSide - 2; ++x) {
        // Samples are spaced by 1 : 4 in each triangle: within it the place on the grid lies between these.
        const float center = (static_cast<float>(x) + 0.5f) * (2.0f / kSide) - 1.0f;
        const float even = (center + kHalfLength) / (2 * kHalfLength);
        const float left = upper_is_far ? even / (4 - 3 * even) : even;
        const float right = upper_is_far ? even : 1 - (1 - even) / (1 + 3 * even);
        ASSERT_GE(pixel(image, x, y).r, 248 * left - 2) << x << "," << y << " " << upper_is_far;
        ASSERT_LE(pixel(image, x, y).r, 248 * right + 2) << x << "," << y << " " << upper_is_far;
      }
    }
  }
}

TEST(Geometry, NearerSurfacesHideFartherOnesInAnyOrder) {
  auto display = make_display(kSide);
  // Distances and gaps that a fixed-point depth buffer would not tell apart.
  for (const auto& [front, gap] :
       {std::pair{1.0f, 0.001f}, {100.0f, 0.01f}, {1000.0f, 0.0625f}, {10000.0f, 1.0f}}) {
    for (bool front_first : {false, true}) {
      SceneBuilder scene;
      const uint32_t object = scene.object();
      const float size = 2 * (front + gap);
      const uint32_t first =
          scene.rectangle(object, -size, -size, size, size, -(front_first ? front : front + gap));
      const uint32_t second =
          scene.rectangle(object, -size, -size, size, size, -(front_first ? front + gap : front));
      scene.color(first, front_first ? kGreen : kRed);
      scene.color(second, front_first ? kRed : kGreen);
      EXPECT_TRUE(near(center_of(scene, *display), kGreen, 0))
          << front << " m, gap " << gap << (front_first ? " first" : " second");
    }
  }
}

// Devices without EXT_clip_control use OpenGL's own depth range.
TEST(Geometry, DepthWorksWithoutClipControl) {
  ASSERT_EQ(setenv("MESA_EXTENSION_OVERRIDE", "-GL_EXT_clip_control", 1), 0);
  auto display = make_display(kSide);
  unsetenv("MESA_EXTENSION_OVERRIDE");
  for (float gap : {-0.01f, 0.01f}) {
    SceneBuilder scene;
    const uint32_t object = scene.object();
    scene.color(scene.rectangle(object, -9, -9, 9, 9, -3), kRed);
    scene.color(scene.rectangle(object, -9, -9, 9, 9, -3 + gap), kGreen);
    EXPECT_TRUE(near(center_of(scene, *display), gap > 0 ? kGreen : kRed, 0));
  }
  SceneBuilder too_near;
  too_near.color(too_near.rectangle(too_near.object(), -1, -1, 1, 1, -0.04f), kGreen);
  EXPECT_TRUE(near(center_of(too_near, *display), kBackground, 0));
}

TEST(Geometry, NothingNearerThanTheNearPlaneIsDrawn) {
  auto display = make_display(kSide);
  for (const auto& [distance, visible] : {std::pair{0.049f, false}, {0.051f, true}, {-0.051f, false}}) {
    SceneBuilder scene;
    scene.color(scene.rectangle(scene.object({.double_sided = true}), -1, -1, 1, 1, -distance), kGreen);
    EXPECT_TRUE(near(center_of(scene, *display), visible ? kGreen : kBackground, 0)) << distance;
  }
}

// A slanted wall: the texel under a pixel follows from its ray, not from the screen distance.
TEST(Geometry, InterpolationIsPerspectiveCorrect) {
  auto display = make_display(kSide);
  SceneBuilder scene;
  const uint32_t patch = scene.patch(scene.object(), {{-1, -1, -1}, {3, -1, -3}, {-1, 1, -1}, {3, 1, -3}});
  scene.block(patch, 0, 0, 5, 5);
  const Image8 image = picture_of(*display, scene.state(), ramp_atlas(), square_view(kSide));
  for (uint32_t x = 4; x < kSide - 4; x += 3) {
    const double tangent = (x + 0.5) / kSide * 2 - 1;
    // (-1 + 4s) = tangent (1 + 2s)
    const double s = (tangent + 1) / (4 - 2 * tangent);
    EXPECT_NEAR(pixel(image, x, kSide / 2).r, 8 * 31 * s, 2.5) << x;
  }
}

std::optional<uint32_t> leftmost_green(const Image8& image) {
  for (uint32_t x = 0; x < image.width; ++x) {
    if (near(pixel(image, x, image.height / 2), kGreen, 0)) return x;
  }
  return std::nullopt;
}

TEST(Geometry, StereoParallaxHasTheRightSignAndSize) {
  auto display = make_display(kSide);
  for (float distance : {1.0f, 2.0f}) {
    SceneBuilder scene;
    scene.color(scene.rectangle(scene.object(), -0.25f, -0.25f, 0.25f, 0.25f, -distance), kGreen);
    ASSERT_TRUE(display->set_atlas(ramp_atlas()).ok());
    ASSERT_TRUE(display->set_state(scene.state()).ok());
    constexpr double kEyeM = 0.125;
    const auto images =
        display->draw_stereo(square_view(kSide, {-kEyeM, 0, 0}), square_view(kSide, {kEyeM, 0, 0}));
    ASSERT_TRUE(images.ok()) << images.status();
    const auto left = leftmost_green(images->left), right = leftmost_green(images->right);
    ASSERT_TRUE(left && right);
    EXPECT_EQ(*left - *right, static_cast<uint32_t>(2 * kEyeM / distance * kSide / 2))
        << "the left eye sees it farther right";
  }
}

// Float alone would be off by 6 cm at this distance.
TEST(Geometry, IsAsPreciseFarFromTheOrigin) {
  auto display = make_display(kSide);
  std::optional<Image8> at_origin;
  for (const dvec3& origin : {dvec3(0), dvec3(1e6, -1e6, 1e6), dvec3(-1e7, 0, 1e7)}) {
    SceneBuilder scene;
    const uint32_t patch = scene.rectangle(scene.object({}, origin), -0.01f, -0.01f, 0.01f, 0.02f, -0.0625f);
    scene.block(patch, 4, 4, 3, 3);
    const Image8 image =
        picture_of(*display, scene.state(), ramp_atlas(), square_view(kSide, origin + dvec3(0.001, 0, 0)));
    if (!at_origin) at_origin = image;
    size_t differing = 0;
    for (uint32_t p = 0; p < kSide * kSide; ++p) {
      differing +=
          near(pixel(image, p % kSide, p / kSide), pixel(*at_origin, p % kSide, p / kSide), 2) ? 0 : 1;
    }
    EXPECT_EQ(differing, 0u) << origin.x;
    EXPECT_FALSE(near(pixel(image, kSide / 2, kSide / 2), kBackground, 5));
  }
}

TEST(Geometry, ObjectsMoveWithTheirTransform) {
  auto display = make_display(kSide);
  SceneBuilder scene;
  scene.color(scene.rectangle(scene.object(), -0.25f, -0.25f, 0.25f, 0.25f, -1), kGreen);
  SceneStore store;
  store.apply(scene.meta());
  const auto before = leftmost_green(picture_of(*display, store.state(), ramp_atlas(), square_view(kSide)));
  geometry_compression::MetaFrame move;
  move.frame = 2;
  move.atlas_width = move.atlas_height = kAtlasSide;
  move.moved.push_back({0, {.translation = {0.5, 0, 0}}});
  store.apply(move);
  const auto after = leftmost_green(picture_of(*display, store.state(), ramp_atlas(), square_view(kSide)));
  ASSERT_TRUE(before && after);
  EXPECT_EQ(*after - *before, kSide / 4);
}

TEST(Geometry, SeveralDisplaysShareAThread) {
  auto first = make_display(kSide);
  auto second = make_display(kSide, 1);
  SceneBuilder green, red;
  green.color(green.screen(green.object()), kGreen);
  red.color(red.screen(red.object()), kRed);
  EXPECT_TRUE(near(center_of(green, *first), kGreen, 0));
  EXPECT_TRUE(near(center_of(red, *second), kRed, 0));
  EXPECT_TRUE(near(pixel(*first->draw(square_view(kSide)), 9, 9), kGreen, 0));
  first.reset();
  EXPECT_TRUE(near(pixel(*second->draw(square_view(kSide)), 9, 9), kRed, 0));
}

}  // namespace
}  // namespace tessera::client
