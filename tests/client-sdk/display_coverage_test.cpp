// Alpha-masked patches: coverage lies in the other half of the block.
#include <gtest/gtest.h>

#include "display_fixture.h"

namespace tessera::client {
namespace {

using namespace test;

constexpr uint32_t kSide = 64;
constexpr Rgb kGreen{0, 200, 0}, kRed{200, 0, 0}, kCovered{159, 159, 159}, kUncovered{96, 96, 96};

// Colour green, covered where the first half of the colour part's x is; everything around would show as red.
Image8 half_covered_atlas(uint32_t width, uint32_t height, uint32_t coverage_x, uint32_t coverage_y) {
  Image8 atlas(kAtlasSide, kAtlasSide);
  fill(atlas, 0, 0, kAtlasSide, kAtlasSide, kRed);
  fill(atlas, 4, 4, width, height, kGreen);
  fill(atlas, 4 + coverage_x, 4 + coverage_y, width, height, kUncovered);
  fill(atlas, 4 + coverage_x, 4 + coverage_y, width / 2, height, kCovered);
  return atlas;
}

// Left half drawn, right half not, with an edge of at most two pixels however large the texels are.
void expect_left_half(const Image8& image, Rgb behind, const char* what) {
  for (uint32_t y = 0; y < kSide; ++y) {
    for (uint32_t x = 0; x < kSide; ++x) {
      if (x + 1 >= kSide / 2 && x <= kSide / 2) continue;
      ASSERT_TRUE(near(pixel(image, x, y), x < kSide / 2 ? kGreen : behind, 1))
          << what << " at " << x << "," << y << ": " << pixel(image, x, y);
      ASSERT_EQ(image.at(x, y)[3], 255);
    }
  }
}

TEST(Coverage, WideBlocksHaveItToTheRight) {
  for (uint32_t samples : {1u, 4u}) {
    auto display = make_display(kSide, samples);
    SceneBuilder scene;
    scene.block(scene.screen(scene.object({.masked = true})), 4, 4, 4, 3);
    expect_left_half(picture_of(*display, scene.state(), half_covered_atlas(8, 8, 8, 0), square_view(kSide)),
                     kBackground, "wide");
  }
}

TEST(Coverage, SquareBlocksHaveItBelow) {
  for (uint32_t samples : {1u, 4u}) {
    auto display = make_display(kSide, samples);
    SceneBuilder scene;
    scene.block(scene.screen(scene.object({.double_sided = true, .masked = true})), 4, 4, 4, 4);
    expect_left_half(picture_of(*display, scene.state(), half_covered_atlas(16, 8, 0, 8), square_view(kSide)),
                     kBackground, "square");
  }
}

TEST(Coverage, TransposedBlocksTurnBothHalves) {
  auto display = make_display(kSide);
  SceneBuilder scene;
  // u runs down the atlas: along the patch's v axis (up) lie the atlas' columns.
  const uint32_t object = scene.object({.double_sided = true, .masked = true});
  const uint32_t patch = scene.patch(object, {{-1, -1, -1}, {-1, 1, -1}, {1, -1, -1}, {1, 1, -1}});
  scene.block(patch, 4, 4, 4, 3, true);
  expect_left_half(picture_of(*display, scene.state(), half_covered_atlas(8, 8, 8, 0), square_view(kSide)),
                   kBackground, "transposed");
}

TEST(Coverage, HolesShowWhatLiesBehind) {
  auto display = make_display(kSide);
  SceneBuilder scene;
  scene.block(scene.screen(scene.object({.masked = true})), 4, 4, 4, 3);
  // Drawn after it: the same group, and farther away.
  scene.color(scene.rectangle(scene.object({.masked = true}), -3, -3, 3, 3, -2), {10, 20, 30});
  expect_left_half(picture_of(*display, scene.state(), half_covered_atlas(8, 8, 8, 0), square_view(kSide)),
                   {10, 20, 30}, "hole");
}

TEST(Coverage, SingleColoursAreWhole) {
  auto display = make_display(kSide);
  SceneBuilder scene;
  scene.color(scene.screen(scene.object({.masked = true})), kGreen);
  const Image8 image =
      picture_of(*display, scene.state(), half_covered_atlas(8, 8, 8, 0), square_view(kSide));
  for (uint32_t p = 0; p < kSide * kSide; ++p)
    ASSERT_TRUE(near(pixel(image, p % kSide, p / kSide), kGreen, 0));
}

// An edge between two texels that falls inside a pixel must cover part of it.
TEST(Coverage, EdgesAreSmoothUnderMultisampling) {
  auto display = make_display(kSide, 4);
  SceneBuilder scene;
  // Slanted: the edge crosses pixels at all fractions.
  const uint32_t patch = scene.patch(scene.object({.masked = true}),
                                     {{-1.2f, -1, -1}, {1.2f, -1, -1}, {-0.8f, 1, -1}, {1.6f, 1, -1}});
  scene.block(patch, 4, 4, 4, 3);
  const Image8 image =
      picture_of(*display, scene.state(), half_covered_atlas(8, 8, 8, 0), square_view(kSide));
  uint32_t partial = 0;
  for (uint32_t y = 0; y < kSide; ++y) {
    uint32_t partial_in_row = 0;
    for (uint32_t x = 0; x < kSide; ++x) {
      const int g = pixel(image, x, y).g;
      EXPECT_LE(pixel(image, x, y).r, 1);
      partial_in_row += g > 10 && g < 190 ? 1 : 0;
    }
    EXPECT_LE(partial_in_row, 2u) << "row " << y;
    partial += partial_in_row;
  }
  EXPECT_GT(partial, kSide / 4);
}

}  // namespace
}  // namespace tessera::client
