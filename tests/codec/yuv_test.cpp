#include "codec/yuv.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pictures.h"

namespace tessera::codec {
namespace {

Image8 flat(uint8_t r, uint8_t g, uint8_t b) {
  Image8 image(2, 2);
  for (int i = 0; i < 4; ++i) {
    image.rgba[4 * i] = r;
    image.rgba[4 * i + 1] = g;
    image.rgba[4 * i + 2] = b;
    image.rgba[4 * i + 3] = 255;
  }
  return image;
}

TEST(Yuv, Bt709ColourBarsHaveTheirPublishedValues) {
  // 100 % bars of ITU-R BT.709 in 8-bit limited range, as in the usual tables.
  const struct {
    uint8_t r, g, b;
    int y, u, v;
  } bars[] = {{255, 255, 255, 235, 128, 128}, {255, 255, 0, 219, 16, 138}, {0, 255, 255, 188, 154, 16},
              {0, 255, 0, 173, 42, 26},       {255, 0, 255, 78, 214, 230}, {255, 0, 0, 63, 102, 240},
              {0, 0, 255, 32, 240, 118},      {0, 0, 0, 16, 128, 128}};
  for (const auto& bar : bars) {
    const YuvImage yuv = rgb_to_yuv(flat(bar.r, bar.g, bar.b));
    EXPECT_EQ(yuv.y[0], bar.y) << int{bar.r} << ' ' << int{bar.g} << ' ' << int{bar.b};
    EXPECT_EQ(yuv.u[0], bar.u) << int{bar.r} << ' ' << int{bar.g} << ' ' << int{bar.b};
    EXPECT_EQ(yuv.v[0], bar.v) << int{bar.r} << ' ' << int{bar.g} << ' ' << int{bar.b};
  }
}

TEST(Yuv, FollowsTheDefiningEquationsWithinHalfAStep) {
  // BT.709 items 3.2-3.5 in floating point.
  for (int r = 0; r < 256; r += 15)
    for (int g = 0; g < 256; g += 15)
      for (int b = 0; b < 256; b += 15) {
        const YuvImage yuv = rgb_to_yuv(flat(uint8_t(r), uint8_t(g), uint8_t(b)));
        const double luma = 0.2126 * r + 0.7152 * g + 0.0722 * b;
        ASSERT_NEAR(yuv.y[3], 16 + 219 * luma / 255, 0.501);
        ASSERT_NEAR(yuv.u[0], 128 + 224 * (b - luma) / 1.8556 / 255, 0.501);
        ASSERT_NEAR(yuv.v[0], 128 + 224 * (r - luma) / 1.5748 / 255, 0.501);
      }
}

TEST(Yuv, GreysHaveNoColourAndComeBackWithinOne) {
  for (int grey = 0; grey < 256; ++grey) {
    const YuvImage yuv = rgb_to_yuv(flat(uint8_t(grey), uint8_t(grey), uint8_t(grey)));
    EXPECT_EQ(yuv.u[0], 128);
    EXPECT_EQ(yuv.v[0], 128);
    const Image8 back = yuv_to_rgb(view_of(yuv));
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(back.at(1, 1)[c], grey, 1);
    EXPECT_EQ(back.at(1, 1)[0], back.at(1, 1)[2]);
    EXPECT_EQ(back.at(0, 1)[3], 255);
  }
}

TEST(Yuv, FlatColoursComeBackWithinTheStepsOfEightBits) {
  // Half a step of each of Y, U, V, through the inverse matrix: 0.58 + 0.5 * 2.11 is the largest, in blue;
  // plus rounding.
  int worst = 0;
  for (int r = 0; r < 256; r += 5)
    for (int g = 0; g < 256; g += 5)
      for (int b = 0; b < 256; b += 5) {
        const Image8 back = yuv_to_rgb(view_of(rgb_to_yuv(flat(uint8_t(r), uint8_t(g), uint8_t(b)))));
        const int rgb[3] = {r, g, b};
        for (int c = 0; c < 3; ++c) worst = std::max(worst, std::abs(back.rgba[c] - rgb[c]));
      }
  EXPECT_LE(worst, 2);
}

TEST(Yuv, ChromaIsTheMeanOfItsSquare) {
  Image8 image = flat(0, 0, 0);
  image.rgba[0] = 255;  // one texel of four is red: a quarter of (102, 240) - 128
  const YuvImage yuv = rgb_to_yuv(image);
  EXPECT_NEAR(yuv.u[0], 128 - 25.68 / 4, 0.51);
  EXPECT_NEAR(yuv.v[0], 128 + 112.0 / 4, 0.51);
  EXPECT_EQ(yuv.y[0], 63);
  EXPECT_EQ(yuv.y[1], 16);
}

TEST(Yuv, ATwoAlignedBlockOwnsItsChroma) {
  // Whatever stands around a block at even coordinates, what comes back inside it is the same.
  constexpr uint32_t kSide = 16, kFrom = 4, kTo = 10;
  Image8 a = noise_image(kSide, kSide, 1), b = noise_image(kSide, kSide, 2);
  for (uint32_t y = kFrom; y < kTo; ++y) std::copy_n(a.at(kFrom, y), 4 * (kTo - kFrom), b.at(kFrom, y));
  const Image8 a2 = yuv_to_rgb(view_of(rgb_to_yuv(a))), b2 = yuv_to_rgb(view_of(rgb_to_yuv(b)));
  for (uint32_t y = kFrom; y < kTo; ++y)
    for (uint32_t i = 0; i < 4 * (kTo - kFrom); ++i) ASSERT_EQ(a2.at(kFrom, y)[i], b2.at(kFrom, y)[i]);
  EXPECT_NE(a2.rgba, b2.rgba);
}

TEST(Yuv, EveryTripleConvertsBackInsideTheRange) {
  // Most (Y, U, V) are no colour at all; they must clamp, not wrap.
  YuvImage yuv{2, 2, std::vector<uint8_t>(4), std::vector<uint8_t>(1), std::vector<uint8_t>(1)};
  for (int u = 0; u < 256; u += 3)
    for (int v = 0; v < 256; v += 3)
      for (int y = 0; y < 256; y += 17) {
        yuv.y[0] = uint8_t(y);
        yuv.u[0] = uint8_t(u);
        yuv.v[0] = uint8_t(v);
        const Image8 rgb = yuv_to_rgb(view_of(yuv));
        const double l = 255.0 / 219 * (y - 16);
        const double want[3] = {l + 1.5748 * 255 / 224 * (v - 128),
                                l - 0.187324 * 255 / 224 * (u - 128) - 0.468124 * 255 / 224 * (v - 128),
                                l + 1.8556 * 255 / 224 * (u - 128)};
        for (int c = 0; c < 3; ++c) ASSERT_NEAR(rgb.rgba[c], std::clamp(want[c], 0.0, 255.0), 0.51);
      }
}

TEST(Yuv, StridesWiderThanTheImageAreHonoured) {
  const Image8 image = noise_image(6, 4, 9);
  const YuvImage yuv = rgb_to_yuv(image);
  std::vector<uint8_t> y(4 * 32, 0xee), u(2 * 32, 0xee), v(2 * 32, 0xee);
  for (uint32_t row = 0; row < 4; ++row) std::copy_n(&yuv.y[6 * row], 6, &y[32 * row]);
  for (uint32_t row = 0; row < 2; ++row) {
    std::copy_n(&yuv.u[3 * row], 3, &u[32 * row]);
    std::copy_n(&yuv.v[3 * row], 3, &v[32 * row]);
  }
  const YuvView wide{6, 4, y.data(), u.data(), v.data(), 32, 32};
  EXPECT_EQ(yuv_to_rgb(wide).rgba, yuv_to_rgb(view_of(yuv)).rgba);
}

}  // namespace
}  // namespace tessera::codec
