#include "bench/metrics.h"

#include <gtest/gtest.h>

#include <set>

#include "bench/color_difference.h"
#include "test_images.h"

namespace tessera::bench {
namespace {

TEST(Metrics, IdenticalPicturesAreWithoutError) {
  const Image8 image = textured(40, 30);
  const Comparison c = compare_images(image, image);
  EXPECT_NEAR(c.error.mssim, 1, 1e-6);
  EXPECT_NEAR(c.error.dssim(), 0, 1e-6);
  EXPECT_NEAR(c.error.ssim7, 1, 1e-6);
  EXPECT_EQ(c.error.psnr, kMaxPsnrDb);
  EXPECT_EQ(c.error.psnr_rgb, kMaxPsnrDb);
  EXPECT_EQ(c.error.linf, 0);
  for (const float s : c.ssim.values) EXPECT_NEAR(s, 1, 1e-4);
}

TEST(Metrics, ConstantPicturesFollowTheClosedForm) {
  // Without variance SSIM is its luminance term alone.
  const double a = 100 / 255.0, b = 140 / 255.0;
  const double expected = (2 * a * b + 1e-4) / (a * a + b * b + 1e-4);
  const Comparison c = compare_images(uniform_image(24, 17, 100), uniform_image(24, 17, 140));
  EXPECT_NEAR(c.error.mssim, expected, 1e-4);
  EXPECT_NEAR(c.error.ssim7, expected, 1e-4);
  EXPECT_NEAR(c.error.psnr, -20 * std::log10(40 / 255.0), 1e-4);
  EXPECT_NEAR(c.error.psnr_rgb, -20 * std::log10(40 / 255.0), 1e-4);
  EXPECT_NEAR(c.error.linf, 40 / 255.0, 1e-9);
  for (const double l2 : c.error.l2) EXPECT_NEAR(l2, 40 / 255.0, 1e-9);
}

// Computed in double precision with numpy, window by window; ssim7 agrees with scikit-image's
// structural_similarity (win_size 7, data_range 1) to every digit.
TEST(Metrics, AgreesWithAnIndependentComputation) {
  const ImageError e = compare_images(textured(13, 11), textured_disturbed(13, 11)).error;
  EXPECT_NEAR(e.mssim, 0.9967228697073393, 2e-6);
  EXPECT_NEAR(e.ssim7, 0.9958862121283362, 2e-6);
  EXPECT_NEAR(e.psnr, 35.912165131345276, 1e-4);
  EXPECT_NEAR(e.psnr_rgb, 31.859915539656125, 1e-9);
  EXPECT_NEAR(e.linf, 0.04313725490196085, 1e-12);
  EXPECT_NEAR(e.l2[0], 0.0253214, 1e-7);
  EXPECT_NEAR(e.l2[1], 0.02581354, 1e-7);
  EXPECT_NEAR(e.l2[2], 0.02544427, 1e-7);
}

TEST(Metrics, SsimIsSymmetricAndLocal) {
  const Image8 a = textured(64, 64);
  Image8 b = a;
  for (uint32_t y = 28; y < 36; ++y) {
    for (uint32_t x = 28; x < 36; ++x) b.at(x, y)[1] ^= 0x80;
  }
  const Comparison ab = compare_images(a, b), ba = compare_images(b, a);
  EXPECT_NEAR(ab.error.mssim, ba.error.mssim, 1e-7);
  EXPECT_LT(ab.ssim.row(32)[32], 0.9f);
  EXPECT_NEAR(ab.ssim.row(22)[10], 1, 1e-4);  // farther than the window's radius of 5
  EXPECT_NEAR(ab.ssim.row(32)[22], 1, 1e-4);
  EXPECT_LT(ab.ssim.row(32)[23], 0.9999f);  // 28 - 5
}

TEST(Metrics, PicturesSmallerThanTheWindow) {
  const ImageError e = compare_images(textured(3, 2), textured(3, 2)).error;
  EXPECT_NEAR(e.mssim, 1, 1e-5);
  EXPECT_NEAR(e.ssim7, 1, 1e-5);
}

struct LabPair {
  glm::dvec3 a, b;
  double delta_e;
};

// Sharma, Wu, Dalal: The CIEDE2000 color-difference formula (2005), table 1.
TEST(ColorDifference, PublishedPairs) {
  const LabPair pairs[] = {{{50, 2.6772, -79.7751}, {50, 0, -82.7485}, 2.0425},
                           {{50, 3.1571, -77.2803}, {50, 0, -82.7485}, 2.8615},
                           {{50, 2.8361, -74.0200}, {50, 0, -82.7485}, 3.4412},
                           {{50, -1.3802, -84.2814}, {50, 0, -82.7485}, 1.0000},
                           {{50, 0, 0}, {50, -1, 2}, 2.3669},
                           {{50, 2.4900, -0.0010}, {50, -2.4900, 0.0009}, 7.1792},
                           {{50, 2.4900, -0.0010}, {50, -2.4900, 0.0011}, 7.2195},
                           {{50, -0.0010, 2.4900}, {50, 0.0009, -2.4900}, 4.8045},
                           {{50, -0.0010, 2.4900}, {50, 0.0011, -2.4900}, 4.7461},
                           {{50, 2.5, 0}, {50, 0, -2.5}, 4.3065},
                           {{50, 2.5, 0}, {73, 25, -18}, 27.1492},
                           {{50, 2.5, 0}, {61, -5, 29}, 22.8977},
                           {{50, 2.5, 0}, {56, -27, -3}, 31.9030},
                           {{50, 2.5, 0}, {58, 24, 15}, 19.4535},
                           {{60.2574, -34.0099, 36.2677}, {60.4626, -34.1751, 39.4387}, 1.2644},
                           {{2.0776, 0.0795, -1.1350}, {0.9033, -0.0636, -0.5514}, 0.9082}};
  for (const LabPair& p : pairs) {
    EXPECT_NEAR(ciede2000(p.a, p.b), p.delta_e, 5e-5);
    EXPECT_NEAR(ciede2000(p.b, p.a), p.delta_e, 5e-5);
    EXPECT_EQ(ciede2000(p.a, p.a), 0);
  }
}

TEST(ColorDifference, LabOfKnownColors) {
  const uint8_t white[3] = {255, 255, 255}, red[3] = {255, 0, 0};
  const glm::dvec3 w = lab_from_srgb(white), r = lab_from_srgb(red);
  EXPECT_NEAR(w.x, 100, 1e-3);
  EXPECT_NEAR(w.y, 0, 1e-2);
  EXPECT_NEAR(w.z, 0, 1e-2);
  EXPECT_NEAR(r.x, 53.24, 0.01);
  EXPECT_NEAR(r.y, 80.09, 0.01);
  EXPECT_NEAR(r.z, 67.20, 0.01);
}

TEST(Metrics, DeltaECountsOnlyTwoPixelsBesideBorders) {
  const uint32_t w = 16, h = 8;
  std::vector<uint32_t> ids(w * h);
  for (uint32_t i = 0; i < ids.size(); ++i) ids[i] = i % w < 8 ? 1 : 2;
  const Image8 truth = uniform_image(w, h, 128);
  Image8 far = truth, near = truth;
  for (uint32_t y = 0; y < h; ++y) {
    far.at(5, y)[0] = far.at(10, y)[0] = 200;  // third column from the border between 7 and 8
    near.at(6, y)[0] = near.at(9, y)[0] = 200;
  }
  EXPECT_EQ(delta_e_near_borders(truth, far, ids), 0);
  const double one = ciede2000(lab_from_srgb(truth.at(6, 0)), lab_from_srgb(near.at(6, 0)));
  EXPECT_NEAR(delta_e_near_borders(truth, near, ids), one / 2, 1e-9);  // two of the four columns 6..9
  EXPECT_EQ(delta_e_near_borders(truth, near, std::vector<uint32_t>(w * h, 7)), 0);
}

TEST(Metrics, HolesAreCoveredPixelsOfInvisibleTriangles) {
  const std::vector<uint32_t> triangles{1, 2, 3, 0, 3, 3, 1, 2};
  const std::vector<uint8_t> covered{1, 1, 1, 0, 0, 1, 1, 1};
  const std::set<uint32_t> visible{0, 1};
  EXPECT_EQ(hole_share(triangles, covered, [&](uint32_t t) { return visible.contains(t); }), 2.0 / 8);
  EXPECT_EQ(hole_share(triangles, covered, [](uint32_t) { return true; }), 0);
}

TEST(Metrics, MeansOverFrames) {
  ErrorMean mean;
  EXPECT_EQ(mean.mean().mssim, 1);
  mean.add({.mssim = 0.9, .psnr = 30, .linf = 0.5, .l2 = {0.1, 0.2, 0.3}});
  mean.add({.mssim = 0.8, .psnr = 40, .linf = 0.2, .l2 = {0.3, 0.2, 0.1}});
  const ImageError m = mean.mean();
  EXPECT_NEAR(m.mssim, 0.85, 1e-12);
  EXPECT_NEAR(m.psnr, 35, 1e-12);
  EXPECT_EQ(m.linf, 0.5);  // the largest
  EXPECT_NEAR(m.l2[0], 0.2, 1e-12);
}

}  // namespace
}  // namespace tessera::bench
