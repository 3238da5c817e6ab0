// What colour a pixel gets: block addressing, filtering, colour conversion.
#include "client-sdk/display.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <string>

#include "codec/yuv.h"
#include "display_fixture.h"

namespace tessera::client {
namespace {

using namespace test;
using ::testing::HasSubstr;

constexpr uint32_t kSide = 64;

// Position of a pixel's centre in a patch that fills the screen: u right, v up.
vec2 patch_position(uint32_t x, uint32_t y) {
  return {(static_cast<float>(x) + 0.5f) / kSide, 1 - (static_cast<float>(y) + 0.5f) / kSide};
}

// The texel of a block corner, from the definition in atlas/placement.h.
vec2 corner_texel(vec2 corner, vec2 origin, vec2 size, bool transposed) {
  if (transposed) std::swap(corner.x, corner.y);
  return origin + glm::floor(corner * (size - 1.0f) + 0.5f) + 0.5f;
}

using Triangle = std::array<vec2, 3>;
const std::vector<std::vector<Triangle>> kPatchTriangles = {
    {{vec2(0, 0), vec2(1, 0), vec2(0, 1)}},
    {{vec2(0, 0), vec2(1, 0), vec2(0, 1)}, {vec2(1, 1), vec2(0, 1), vec2(1, 0)}},
    {{vec2(0, 0), vec2(1, 0), vec2(.5f, 1)},
     {vec2(0, 1), vec2(0, 0), vec2(.5f, 1)},
     {vec2(1, 0), vec2(1, 1), vec2(.5f, 1)}}};
const std::vector<std::vector<vec2>> kPatchCorners = {
    {{0, 0}, {1, 0}, {0, 1}}, {{0, 0}, {1, 0}, {0, 1}, {1, 1}}, {{0, 0}, {1, 0}, {.5f, 1}, {0, 1}, {1, 1}}};

vec3 barycentric(const Triangle& t, vec2 p) {
  const auto area = [](vec2 a, vec2 b, vec2 c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
  };
  const float whole = area(t[0], t[1], t[2]);
  return {area(p, t[1], t[2]) / whole, area(t[0], p, t[2]) / whole, area(t[0], t[1], p) / whole};
}

// The inverse of how the server spaces samples: the texel is the mean of the corners', weighted by distance.
TEST(Display, ReadsSpacedSamplesWhereTheyAre) {
  auto display = make_display(kSide);
  SceneBuilder scene;
  std::vector<vec3> corners;
  for (vec2 c : kPatchCorners[1]) corners.emplace_back(2 * c.x - 1, 2 * c.y - 1, -1);
  scene.block(scene.patch(scene.object(), corners), 6, 10, 4, 4);
  scene.meta().placements[0].width = 14;
  scene.meta().placements[0].spacing = {21, -21, 63, 0};
  const float distance[2][3] = {{1, 2, 0.5f}, {8, 0.5f, 2}};
  const Image8 image = picture_of(*display, scene.state(), ramp_atlas(), square_view(kSide));
  size_t checked = 0;
  for (uint32_t y = 0; y < kSide; ++y) {
    for (uint32_t x = 0; x < kSide; ++x) {
      for (int t = 0; t < 2; ++t) {
        const vec3 b = barycentric(kPatchTriangles[1][t], patch_position(x, y));
        if (b.x < 0.02f || b.y < 0.02f || b.z < 0.02f) continue;
        vec2 texel(0);
        float sum = 0;
        for (int i = 0; i < 3; ++i) {
          const float weight = b[i] * distance[t][i];
          texel += weight * corner_texel(kPatchTriangles[1][t][i], vec2(6, 10), vec2(14, 16), false);
          sum += weight;
        }
        texel /= sum;
        ++checked;
        const Rgb expected{int(std::lround(8 * (texel.x - .5f))), int(std::lround(8 * (texel.y - .5f))), 0};
        ASSERT_TRUE(near(pixel(image, x, y), expected, 2))
            << " at " << x << "," << y << ": " << pixel(image, x, y) << " instead of " << expected;
      }
    }
  }
  EXPECT_GT(checked, kSide * kSide * 3 / 4);
}

// Every corner kind, both orientations, square, wide and high blocks: the picture's colours say where it
// sampled.
TEST(Display, SamplesWhereThePlacementSays) {
  auto display = make_display(kSide);
  for (size_t triangles = 1; triangles <= 3; ++triangles) {
    for (const auto& [log_w, log_h] : {std::pair{4u, 4u}, {4u, 3u}, {2u, 3u}, {1u, 1u}}) {
      for (bool transposed : {false, true}) {
        SceneBuilder scene;
        std::vector<vec3> corners;
        for (vec2 c : kPatchCorners[triangles - 1]) corners.emplace_back(2 * c.x - 1, 2 * c.y - 1, -1);
        scene.block(scene.patch(scene.object(), corners), 6, 10, log_w, log_h, transposed);
        const Image8 image = picture_of(*display, scene.state(), ramp_atlas(), square_view(kSide));
        size_t checked = 0;
        for (uint32_t y = 0; y < kSide; ++y) {
          for (uint32_t x = 0; x < kSide; ++x) {
            for (const Triangle& triangle : kPatchTriangles[triangles - 1]) {
              const vec3 b = barycentric(triangle, patch_position(x, y));
              if (b.x < 0.02f || b.y < 0.02f || b.z < 0.02f) continue;  // another triangle, or a shared pixel
              vec2 texel(0);
              for (int i = 0; i < 3; ++i) {
                texel +=
                    b[i] * corner_texel(triangle[i], vec2(6, 10), vec2(1 << log_w, 1 << log_h), transposed);
              }
              ++checked;
              const Rgb expected{int(std::lround(8 * (texel.x - .5f))), int(std::lround(8 * (texel.y - .5f))),
                                 0};
              ASSERT_TRUE(near(pixel(image, x, y), expected, 1))
                  << triangles << " triangles, " << log_w << "x" << log_h << (transposed ? " transposed" : "")
                  << " at " << x << "," << y << ": " << pixel(image, x, y) << " instead of " << expected;
            }
          }
        }
        EXPECT_GT(checked, kSide * kSide / 3);
      }
    }
  }
}

TEST(Display, RowZeroIsTheTop) {
  auto display = make_display(kSide);
  SceneBuilder scene;
  const uint32_t object = scene.object();
  scene.color(scene.rectangle(object, -1, 0, 1, 1, -1), {200, 10, 20});  // upper half
  const Image8 image = picture_of(*display, scene.state(), ramp_atlas(), square_view(kSide));
  for (uint32_t x = 0; x < kSide; ++x) {
    for (uint32_t y = 0; y < kSide; ++y) {
      ASSERT_TRUE(near(pixel(image, x, y), y < kSide / 2 ? Rgb{200, 10, 20} : kBackground, 0))
          << x << "," << y;
      ASSERT_EQ(image.at(x, y)[3], 255);
    }
  }
}

// A block amid magenta: its own green, whatever the angle, the size and the anti-aliasing.
TEST(Display, NeighboursNeverBleedIntoABlock) {
  for (uint32_t samples : {1u, 4u}) {
    auto display = make_display(kSide, samples);
    for (const auto& [log_w, log_h] : {std::pair{1u, 1u}, {2u, 1u}, {3u, 3u}}) {
      Image8 atlas(kAtlasSide, kAtlasSide);
      fill(atlas, 0, 0, kAtlasSide, kAtlasSide, {255, 0, 255});
      fill(atlas, 8, 8, 1 << log_w, 1 << log_h, {0, 255, 0});
      std::mt19937 random(3);
      const auto coordinate = [&] { return static_cast<float>(random() % 2001) / 1000.0f - 1.0f; };
      for (int i = 0; i < 25; ++i) {
        SceneBuilder scene;
        const vec3 origin(0.5f * coordinate(), 0.5f * coordinate(), -1.2f + 0.5f * coordinate());
        const vec3 right(coordinate(), coordinate(), coordinate()),
            up(coordinate(), coordinate(), coordinate());
        const uint32_t patch = scene.patch(scene.object({.double_sided = true}),
                                           {origin, origin + right, origin + up, origin + right + up});
        scene.block(patch, 8, 8, log_w, log_h, i % 2 == 0);
        const Image8 image = picture_of(*display, scene.state(), atlas, square_view(kSide));
        for (uint32_t p = 0; p < kSide * kSide; ++p)
          ASSERT_EQ(image.rgba[4 * p], 0) << "red can only come from a neighbour";
      }
    }
  }
}

TEST(Display, SingleColoursAreExact) {
  auto display = make_display(kSide);
  for (const Rgb& color : {Rgb{1, 2, 3}, Rgb{255, 128, 0}, Rgb{254, 17, 99}}) {
    SceneBuilder scene;
    scene.color(scene.screen(scene.object()), color);
    const Image8 image = picture_of(*display, scene.state(), ramp_atlas(), square_view(kSide));
    for (uint32_t p = 0; p < kSide * kSide; ++p)
      ASSERT_TRUE(near(pixel(image, p % kSide, p / kSide), color, 0));
  }
}

YuvImage random_yuv() {
  std::mt19937 random(5);
  YuvImage yuv{kAtlasSide, kAtlasSide, {}, {}, {}};
  yuv.y.resize(kAtlasSide * kAtlasSide);
  yuv.u.resize(yuv.y.size() / 4);
  yuv.v.resize(yuv.y.size() / 4);
  for (auto* plane : {&yuv.y, &yuv.u, &yuv.v}) {
    for (auto& v : *plane) v = static_cast<uint8_t>(random());
  }
  return yuv;
}

// Screen pixel = texel, so each one shows its conversion alone. All code values, also those beyond the
// limited range.
TEST(Display, ConvertsYuvAsTheReferenceDoes) {
  auto display = make_display(kAtlasSide, 1);
  const YuvImage yuv = random_yuv();
  const Image8 expected = codec::yuv_to_rgb(codec::view_of(yuv));
  SceneBuilder scene;
  // Between the centres of the first and last pixel.
  constexpr float kEdge = 1 - 1.0f / kAtlasSide;
  const uint32_t patch =
      scene.patch(scene.object({.double_sided = true}),
                  {{-kEdge, kEdge, -1}, {kEdge, kEdge, -1}, {-kEdge, -kEdge, -1}, {kEdge, -kEdge, -1}});
  scene.block(patch, 0, 0, 5, 5);
  const Image8 image = picture_of(*display, scene.state(), codec::view_of(yuv), square_view(kAtlasSide));
  for (uint32_t y = 1; y + 1 < kAtlasSide; ++y) {
    for (uint32_t x = 1; x + 1 < kAtlasSide; ++x) {
      ASSERT_TRUE(near(pixel(image, x, y), pixel(expected, x, y), 2)) << x << "," << y;
    }
  }
}

TEST(Display, ChromaIsReplicatedNotFilteredAcrossBlocks) {
  auto display = make_display(kSide);
  YuvImage yuv = random_yuv();  // neighbours of every colour
  for (uint32_t i : {8u * kAtlasSide + 8, 8u * kAtlasSide + 9, 9u * kAtlasSide + 8, 9u * kAtlasSide + 9})
    yuv.y[i] = 120;
  yuv.u[4 * kAtlasSide / 2 + 4] = 200;
  yuv.v[4 * kAtlasSide / 2 + 4] = 60;
  const Rgb expected = pixel(codec::yuv_to_rgb(codec::view_of(yuv)), 8, 8);
  SceneBuilder scene;
  scene.block(scene.screen(scene.object()), 8, 8, 1, 1);
  const Image8 image = picture_of(*display, scene.state(), codec::view_of(yuv), square_view(kSide));
  for (uint32_t p = 0; p < kSide * kSide; ++p)
    ASSERT_TRUE(near(pixel(image, p % kSide, p / kSide), expected, 1));
}

// More records and vertices than one row of the tables; then changes to a few of them.
TEST(Display, FollowsChangesInLargeScenes) {
  constexpr uint32_t kColumns = 64;
  auto display = make_display(kColumns);
  SceneStore store;
  SceneBuilder scene;
  const uint32_t object = scene.object();
  const auto color_of = [](uint32_t patch, uint32_t frame) {
    return Rgb{static_cast<int>(patch % 251), static_cast<int>(patch / 251 * 10),
               static_cast<int>(frame * 30)};
  };
  constexpr float kCell = 2.0f / kColumns;
  for (uint32_t i = 0; i < kColumns * kColumns; ++i) {
    const float x = -1 + kCell * static_cast<float>(i % kColumns),
                y = 1 - kCell * static_cast<float>(i / kColumns + 1);
    scene.color(scene.rectangle(object, x, y, x + kCell, y + kCell, -1), color_of(i, 0));
  }
  store.apply(scene.meta());
  std::vector<uint32_t> changed_in(kColumns * kColumns, 0);
  std::vector<bool> visible(kColumns * kColumns, true);
  std::mt19937 random(2);
  for (uint32_t frame = 0; frame < 6; ++frame) {
    const Image8 image = picture_of(*display, store.state(), ramp_atlas(), square_view(kColumns));
    for (uint32_t i = 0; i < kColumns * kColumns; ++i) {
      ASSERT_TRUE(near(pixel(image, i % kColumns, i / kColumns),
                       visible[i] ? color_of(i, changed_in[i]) : kBackground, 0))
          << "frame " << frame << " patch " << i;
    }
    geometry_compression::MetaFrame next;
    next.frame = frame + 2;
    next.atlas_width = next.atlas_height = kAtlasSide;
    for (uint32_t i = random() % 50; i < kColumns * kColumns; i += 1 + random() % 200) {
      visible[i] = random() % 2;
      changed_in[i] = frame + 1;
      next.placements.push_back({.patch = i});
      if (visible[i]) {
        next.placements.back().kind = geometry_compression::PlacementKind::color;
        next.placements.back().rgb = packed(color_of(i, frame + 1));
      }
    }
    store.apply(next);
  }
}

TEST(Display, ShowsTheBackgroundBeforeAnyState) {
  auto display = make_display(kSide);
  const auto image = display->draw(square_view(kSide));
  ASSERT_TRUE(image.ok()) << image.status();
  EXPECT_TRUE(near(pixel(*image, 5, 5), kBackground, 0));
  EXPECT_FALSE(display->renderer().empty());
}

TEST(Display, RefusesWhatDoesNotFit) {
  auto display = make_display(kSide);
  EXPECT_THAT(std::string(display->draw(square_view(32)).status().message()),
              HasSubstr("32x32 pixels, but the display was made for 64x64"));
  View empty = square_view(kSide);
  empty.fov.left = 2;
  EXPECT_EQ(display->draw(empty).status().code(), absl::StatusCode::kInvalidArgument);
  SceneBuilder scene;
  scene.screen(scene.object());
  ASSERT_TRUE(display->set_state(scene.state()).ok());
  ASSERT_TRUE(display->set_atlas(Image8(16, 16)).ok());
  EXPECT_EQ(display->draw(square_view(kSide)).status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(display->set_atlas(YuvView{.width = 15, .height = 16}).code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(display->set_atlas(Image8(1u << 20, 1)).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(Display::create({.samples = 99}).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(Display::create({.width = 0}).status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace tessera::client
