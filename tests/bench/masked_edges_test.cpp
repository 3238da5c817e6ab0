#include "bench/masked_edges.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "bench/scoring.h"
#include "test_images.h"

namespace tessera::bench {
namespace {

// Three instances of two triangles each; the second one's material is masked.
scene::Scene three_quads() {
  scene::Scene scene;
  scene.geometries.resize(1);
  scene.geometries[0].indices = {0, 1, 2, 2, 1, 3};
  scene.materials.resize(2);
  scene.materials[1].alpha_mode = scene::AlphaMode::mask;
  for (uint32_t i = 0; i < 3; ++i)
    scene.instances.push_back({.geometry = 0, .material = i == 1, .node = 0, .first_triangle = 2 * i});
  return scene;
}

// A picture of three columns of ids: opaque (1), masked (3), background.
constexpr uint32_t kWidth = 30, kHeight = 12;
std::vector<uint32_t> columns() {
  std::vector<uint32_t> ids;
  for (uint32_t i = 0; i < kWidth * kHeight; ++i)
    ids.push_back(i % kWidth < 10 ? 1 : i % kWidth < 20 ? 3 : 0);
  return ids;
}

TEST(MaskedTriangles, AreThoseOfMaskedMaterials) {
  const MaskedTriangles masked(three_quads());
  EXPECT_FALSE(masked.empty());
  for (uint32_t t = 0; t < 7; ++t) EXPECT_EQ(masked.contains(t), t == 2 || t == 3) << t;
}

TEST(MaskedTriangles, ASceneWithoutMasksHasNone) {
  scene::Scene scene = three_quads();
  scene.materials[1].alpha_mode = scene::AlphaMode::blend;
  EXPECT_TRUE(MaskedTriangles(scene).empty());
}

TEST(MaskedEdges, LieBetweenMaskedAndOtherPixels) {
  const auto edges = masked_edges(columns(), kWidth, kHeight, MaskedTriangles(three_quads()));
  for (uint32_t x = 0; x < kWidth; ++x)
    EXPECT_EQ(edges[5 * kWidth + x], x == 9 || x == 10 || x == 19 || x == 20) << x;
}

TEST(MaskedEdges, TwoTrianglesOfMaskedMaterialsHaveNone) {
  std::vector<uint32_t> ids(kWidth * kHeight, 3);
  for (size_t i = 0; i < ids.size(); i += 2) ids[i] = 4;
  const auto edges = masked_edges(ids, kWidth, kHeight, MaskedTriangles(three_quads()));
  EXPECT_EQ(std::count(edges.begin(), edges.end(), 1), 0);
}

TEST(MaskedEdges, TheMeanTakesTwoPixelsToEitherSide) {
  const auto edges = masked_edges(columns(), kWidth, kHeight, MaskedTriangles(three_quads()));
  Plane ssim(kWidth, kHeight);
  std::ranges::fill(ssim.values, 0.25f);
  for (uint32_t y = 0; y < kHeight; ++y) {
    for (const uint32_t x : {8, 9, 10, 11, 18, 19, 20, 21}) ssim.row(y)[x] = 0.5f;
  }
  const EdgeSum near = sum_near(edges, ssim);
  EXPECT_EQ(near.pixels, 8u * kHeight);
  EXPECT_EQ(near.mean(), 0.5);
  EXPECT_EQ(EdgeSum().mean(), 1);
}

TEST(BusiestWindow, HoldsTheMostEdges) {
  std::vector<uint8_t> edges(kWidth * kHeight);
  edges[0] = 1;
  for (const uint32_t x : {20, 22, 24}) edges[7 * kWidth + x] = 1;
  const Window window = busiest_window(edges, kWidth, kHeight, 5);
  EXPECT_EQ(window.edges, 3u);
  EXPECT_EQ(window.x, 20u);
  EXPECT_EQ(window.y, 3u);  // the first in reading order that reaches row 7
  EXPECT_EQ(window.width, 5u);
  EXPECT_EQ(window.height, 5u);
}

TEST(BusiestWindow, FitsIntoSmallPicturesAndMayBeEmpty) {
  const std::vector<uint8_t> none(kWidth * kHeight);
  const Window window = busiest_window(none, kWidth, kHeight, 240);
  EXPECT_EQ(window.edges, 0u);
  EXPECT_EQ(window.width, kWidth);
  EXPECT_EQ(window.height, kHeight);
}

TEST(Enlarged, RepeatsThePixelsOfTheWindow) {
  const Image8 image = textured(20, 10);
  Plane plane(20, 10);
  for (size_t i = 0; i < plane.values.size(); ++i) plane.values[i] = static_cast<float>(i);
  const Window window{3, 4, 6, 5};
  const Image8 large = enlarged(image, window, 2);
  const Plane large_plane = enlarged(plane, window, 2);
  ASSERT_EQ(large.width, 12u);
  ASSERT_EQ(large.height, 10u);
  for (uint32_t y = 0; y < 10; ++y) {
    for (uint32_t x = 0; x < 12; ++x) {
      EXPECT_EQ(std::memcmp(large.at(x, y), image.at(3 + x / 2, 4 + y / 2), 4), 0);
      EXPECT_EQ(large_plane.row(y)[x], plane.row(4 + y / 2)[3 + x / 2]);
    }
  }
}

FramePictures pictures(std::vector<uint32_t> ids) {
  auto truth = std::make_shared<shading::ReferenceImage>();
  truth->color = textured(kWidth, kHeight);
  truth->triangle_plus_one = std::move(ids);
  FramePictures result{.index = 3, .truth = std::move(truth)};
  result.shown = {textured_disturbed(kWidth, kHeight), textured(kWidth, kHeight)};
  return result;
}

TEST(Score, EveryMethodAgainstTheTruth) {
  const FramePictures p = pictures(columns());
  const FrameScore result = score(p, MaskedTriangles(three_quads()));
  ASSERT_EQ(result.methods.size(), 2u);
  const Comparison alone = compare_images(p.truth->color, p.shown[0], p.truth->triangle_plus_one);
  EXPECT_EQ(result.methods[0].error.mssim, alone.error.mssim);
  EXPECT_EQ(result.methods[0].error.delta_e_borders, alone.error.delta_e_borders);
  EXPECT_EQ(result.methods[1].error.psnr, kMaxPsnrDb);
  ASSERT_EQ(result.near_masked.size(), 2u);
  EXPECT_LT(result.near_masked[0].mean(), result.near_masked[1].mean());
  EXPECT_FALSE(result.split.has_value());
}

TEST(Score, WithoutMaskedMaterialsNothingIsSaidOfThem) {
  const FrameScore result = score(pictures(columns()), MaskedTriangles(scene::Scene()));
  EXPECT_TRUE(result.near_masked.empty());
  EXPECT_TRUE(result.masked_edges.empty());
}

TEST(Score, TheSplitAgreesWithTheWholeComparison) {
  FramePictures p = pictures(columns());
  const Image8 disturbed = textured_disturbed(kWidth, kHeight), exact = textured(kWidth, kHeight);
  p.split = {disturbed, exact, disturbed, exact};
  const FrameScore result = score(p, MaskedTriangles(three_quads()));
  ASSERT_TRUE(result.split.has_value());
  EXPECT_EQ(result.split->chroma_only.mssim, result.methods[0].error.mssim);
  EXPECT_EQ(result.split->fresh.psnr, result.methods[0].error.psnr);
  EXPECT_EQ(result.split->uncoded.psnr, kMaxPsnrDb);
  EXPECT_NEAR(result.split->seen.mssim, 1, 1e-6);
}

}  // namespace
}  // namespace tessera::bench
