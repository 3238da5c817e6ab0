// Triangles with an L or halves of their own: every pixel finds its sample. The atlas is painted sample by
// sample with the triangle's own coordinates.
#include <gtest/gtest.h>

#include <algorithm>

#include "atlas/addressing/addressing.h"
#include "display_fixture.h"

namespace tessera::client {
namespace {

using namespace test;
namespace addressing = atlas::addressing;
using geometry_compression::PatchPlacement;
using geometry_compression::PlacementKind;

constexpr uint32_t kSide = 64;

// Red and green: coordinates of the triangle's second and third corner; white is where nothing may be read.
void paint(Image8& atlas, const addressing::ivec2& at, vec2 weights) {
  const vec2 c = 255.0f * weights + 0.5f;
  fill(atlas, static_cast<uint32_t>(at.x), static_cast<uint32_t>(at.y), 1, 1,
       {static_cast<int>(std::clamp(c.x, 0.0f, 255.0f)), static_cast<int>(std::clamp(c.y, 0.0f, 255.0f)), 0});
}

Image8 white() {
  Image8 atlas(kAtlasSide, kAtlasSide);
  fill(atlas, 0, 0, kAtlasSide, kAtlasSide, {255, 255, 255});
  return atlas;
}

vec2 ratios_of(const PatchPlacement& p) {
  return {addressing::ratio_from_code(p.spacing[0] + addressing::kRatioCodeOne),
          addressing::ratio_from_code(p.spacing[1] + addressing::kRatioCodeOne)};
}

void paint_l(Image8& atlas, const PatchPlacement& p) {
  for (int i = 0; i < p.l.splits * p.l.splits; ++i) {
    const int half = i + p.l.turned, level = p.l.level;
    const addressing::ivec2 pair =
        addressing::l_pair_place(half / 2, {p.x, p.y}, p.l.next_y, level, int{kAtlasSide});
    const addressing::SplitPlace place = addressing::split_place(i, p.l.splits);
    for (int k = 0; k < addressing::l_samples(level); ++k) {
      const addressing::ivec2 texel = addressing::l_sample(k, level);
      const vec3 local = addressing::l_barycentric(texel, level);
      const vec2 s = place.corner + place.scale * vec2(local.y, local.z);
      const vec3 on_surface = addressing::to_surface({1 - s.x - s.y, s.x, s.y}, ratios_of(p));
      paint(atlas, pair + addressing::l_pair_texel(texel, half % 2 == 1, level),
            {on_surface.y, on_surface.z});
    }
  }
}

void paint_halves(Image8& atlas, const PatchPlacement& p) {
  const auto& h = p.halves;
  for (int number = 0; number < 2; ++number) {
    const auto& half = h.half[number];
    const addressing::ivec2 size = addressing::half_staircase(h.across, half.along);
    for (int k = 0; k < addressing::staircase_samples(size); ++k) {
      const addressing::ivec2 at = addressing::staircase_position(k, size);
      const addressing::HalfSample sample =
          addressing::half_weights(at, h.across, half.along, number, addressing::foot_from_code(h.foot));
      vec3 s;
      s[h.apex] = sample.weights.y;
      s[(h.apex + 2) % 3] = sample.weights.x;
      s[(h.apex + 1) % 3] = 1 - sample.weights.x - sample.weights.y;
      const vec3 on_surface = addressing::to_surface(s, ratios_of(p));
      paint(atlas, addressing::ivec2(half.x, half.y) + addressing::half_texel(at, size, half.turned),
            {on_surface.y, on_surface.z});
    }
  }
}

// A lone triangle with its corners at (-1, -1), (1, -1), (-1, 1), one metre ahead.
void expect_coordinates(Display& display, PatchPlacement p, const Image8& atlas, int tolerance,
                        const char* what) {
  SceneBuilder scene;
  p.part = 1;
  p.patch = scene.patch(scene.object(), {{-1, -1, -1}, {1, -1, -1}, {-1, 1, -1}});
  scene.meta().placements = {p};
  const Image8 image = picture_of(display, scene.state(), atlas, square_view(kSide));
  size_t checked = 0;
  for (uint32_t y = 0; y < kSide; ++y) {
    for (uint32_t x = 0; x < kSide; ++x) {
      const vec2 at((float(x) + 0.5f) / kSide, 1 - (float(y) + 0.5f) / kSide);
      if (at.x + at.y > 0.98f) continue;
      ++checked;
      const Rgb expected{static_cast<int>(255 * at.x), static_cast<int>(255 * at.y), 0};
      ASSERT_TRUE(near(pixel(image, x, y), expected, tolerance))
          << what << " at " << x << "," << y << ": " << pixel(image, x, y) << " instead of " << expected;
    }
  }
  EXPECT_GT(checked, kSide * kSide * 2 / 5);
}

TEST(Triangles, EveryPixelFindsItsSampleInAnL) {
  auto display = make_display(kSide);
  for (const int level : {1, 2, 3, 7, 12, 15}) {
    for (const bool turned : {false, true}) {
      PatchPlacement p{.kind = PlacementKind::l, .x = 2, .y = 6};
      p.l = {static_cast<uint8_t>(level), 1, turned, 0};
      Image8 atlas = white();
      paint_l(atlas, p);
      // Along the folds interpolation is off by up to a sixth of a step (l_packing.glsl).
      expect_coordinates(*display, p, atlas, 255 / (6 * level) + 3, "L");
    }
  }
}

TEST(Triangles, SplitOnesFindTheirSubTriangle) {
  auto display = make_display(kSide);
  for (const int splits : {2, 3, 5}) {
    PatchPlacement p{.kind = PlacementKind::l, .x = 22, .y = 2};
    p.l = {3, static_cast<uint8_t>(splits), true, 8};
    Image8 atlas = white();
    paint_l(atlas, p);
    expect_coordinates(*display, p, atlas, 255 / (18 * splits) + 3, "split");
  }
}

TEST(Triangles, EveryPixelFindsItsSampleInHalves) {
  auto display = make_display(kSide);
  for (const uint8_t apex : {0, 1, 2}) {
    for (const uint8_t foot : {0, 20, 63}) {
      for (const uint8_t across : {2, 6}) {
        PatchPlacement p{.kind = PlacementKind::halves};
        p.halves = {apex, foot, across, {{{1, 2, 3, false}, {4, 16, 20, true}}}};
        Image8 atlas = white();
        paint_halves(atlas, p);
        // Samples outside the triangle have coordinates that a colour cannot hold: between them and the edge.
        expect_coordinates(*display, p, atlas, 255 / (2 * std::min<int>(across, 3)) + 3, "halves");
      }
    }
  }
}

// Of many samples, so that what lies between them is nearly straight.
TEST(Triangles, SpacedSamplesAreReadWhereTheyAre) {
  auto display = make_display(kSide);
  PatchPlacement p{.kind = PlacementKind::l, .x = 0, .y = 0};
  p.spacing = {21, -14};
  p.l = {18, 1, false, 0};
  Image8 atlas = white();
  paint_l(atlas, p);
  expect_coordinates(*display, p, atlas, 10, "spaced");
  PatchPlacement other = p;
  other.spacing = {};
  SceneBuilder scene;
  other.part = 1;
  other.patch = scene.patch(scene.object(), {{-1, -1, -1}, {1, -1, -1}, {-1, 1, -1}});
  scene.meta().placements = {other};
  const Image8 unspaced = picture_of(*display, scene.state(), atlas, square_view(kSide));
  EXPECT_FALSE(near(pixel(unspaced, 20, 40), {int(255 * 20.5 / 64), int(255 * 23.5 / 64), 0}, 20));
}

}  // namespace
}  // namespace tessera::client
