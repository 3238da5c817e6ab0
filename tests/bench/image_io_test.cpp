#include "bench/image_io.h"

#include <gtest/gtest.h>

#include "bench/temporary_folder.h"
#include "test_images.h"

namespace tessera::bench {
namespace {

TEST(ImageIo, PngKeepsEveryPixel) {
  const TemporaryFolder folder;
  const Image8 image = textured(37, 21);
  ASSERT_TRUE(write_png(folder.path() / "a.png", image).ok());
  const auto read = read_png(folder.path() / "a.png");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->width, 37u);
  EXPECT_EQ(read->rgba, image.rgba);
}

TEST(ImageIo, DamagedDataIsRefused) {
  std::vector<uint8_t> png = encode_png(textured(16, 16));
  EXPECT_FALSE(decode_png({}, "empty").ok());
  EXPECT_FALSE(decode_png(std::span(png).first(20), "cut").ok());
  png[1] ^= 0xff;
  EXPECT_FALSE(decode_png(png, "magic").ok());
}

TEST(ImageIo, JpegIsCloseAndSmaller) {
  const Image8 image =
      make_image(64, 64, [](uint32_t x, uint32_t y, uint32_t c) { return c == 0 ? 4 * x : 3 * y; });
  const auto read = decode_png(encode_jpeg(image), "jpeg");  // stb tells formats apart by itself
  ASSERT_TRUE(read.ok());
  for (size_t i = 0; i < image.rgba.size(); ++i) ASSERT_NEAR(image.rgba[i], read->rgba[i], 12);
}

TEST(ImageIo, DssimColorsBrightenWithTheError) {
  Plane ssim(64, 1);
  for (uint32_t x = 0; x < 64; ++x) ssim.values[x] = 1 - static_cast<float>(x) / 63;  // DSSIM 0 … 0.5
  const Image8 picture = dssim_picture(ssim, 0.5f);
  const Plane brightness = luma(picture);
  EXPECT_LT(brightness.values[0], 0.01f);
  for (uint32_t x = 1; x < 64; ++x) EXPECT_GT(brightness.values[x], brightness.values[x - 1]);
  ssim.values.assign(64, -1);  // beyond full scale
  const Image8 saturated = dssim_picture(ssim, 0.5f);
  EXPECT_TRUE(std::equal(saturated.at(5, 0), saturated.at(5, 0) + 4, picture.at(63, 0)));
}

}  // namespace
}  // namespace tessera::bench
