#include "codec/yuv_converter.h"

#include <gtest/gtest.h>

#include "codec/yuv.h"
#include "gpu/buffer.h"
#include "pictures.h"

namespace tessera::codec {
namespace {

using gpu::Format;

class YuvConverterTest : public testing::Test {
 protected:
  void SetUp() override {
    auto device = gpu::Device::create({.select = "cpu", .validation = true});
    ASSERT_TRUE(device.ok()) << device.status();
    device_ = *std::move(device);
  }
  void TearDown() override {
    if (device_) {
      EXPECT_EQ(device_->validation_messages(), 0u);
    }
  }

  gpu::Image image(uint32_t width, uint32_t height, Format format, bool storage = true) {
    auto made = gpu::Image::create(*device_, {width, height, format, 1, 1, 1, storage}, "atlas");
    EXPECT_TRUE(made.ok()) << made.status();
    return *std::move(made);
  }

  void expect_same(const YuvView& device, const YuvImage& cpu) {
    for (uint32_t y = 0; y < cpu.height; ++y)
      for (uint32_t x = 0; x < cpu.width; ++x)
        ASSERT_EQ(device.y[size_t{y} * device.y_stride + x], cpu.y[size_t{y} * cpu.width + x])
            << x << ' ' << y;
    for (uint32_t y = 0; y < cpu.height / 2; ++y)
      for (uint32_t x = 0; x < cpu.width / 2; ++x) {
        const size_t at = size_t{y} * (cpu.width / 2) + x;
        ASSERT_EQ(device.u[size_t{y} * device.uv_stride + x], cpu.u[at]) << x << ' ' << y;
        ASSERT_EQ(device.v[size_t{y} * device.uv_stride + x], cpu.v[at]) << x << ' ' << y;
      }
  }

  void convert_and_compare(YuvConverter& converter, const gpu::Image& target, const Image8& pixels) {
    auto staging = gpu::Buffer::create(*device_, pixels.rgba.size(), gpu::Memory::upload, "pixels");
    ASSERT_TRUE(staging.ok()) << staging.status();
    std::copy(pixels.rgba.begin(), pixels.rgba.end(), staging->as<uint8_t>().begin());
    gpu::Commands commands = device_->begin();
    commands.copy_to_image(*staging, 0, target);
    ASSERT_TRUE(converter.record(commands, target).ok());
    const Status status = device_->run(std::move(commands));
    ASSERT_TRUE(status.ok()) << status;
    expect_same(converter.result(), rgb_to_yuv(pixels));
  }

  std::shared_ptr<gpu::Device> device_;
};

TEST_F(YuvConverterTest, GivesTheReferencesBytes) {
  // Sizes that do and do not fill the work groups.
  for (const auto& [width, height] : {std::pair{8u, 2u}, {64u, 16u}, {72u, 18u}, {200u, 66u}}) {
    SCOPED_TRACE(testing::Message() << width << 'x' << height);
    auto converter = YuvConverter::create(*device_, width, height);
    ASSERT_TRUE(converter.ok()) << converter.status();
    const gpu::Image target = image(width, height, Format::rgba8_srgb);
    convert_and_compare(**converter, target, noise_image(width, height, width));
  }
}

TEST_F(YuvConverterTest, FollowsTheImageThatItIsGiven) {
  auto converter = YuvConverter::create(*device_, 32, 16);
  ASSERT_TRUE(converter.ok()) << converter.status();
  const gpu::Image first = image(32, 16, Format::rgba8_srgb), second = image(32, 16, Format::rgba8_unorm);
  convert_and_compare(**converter, first, noise_image(32, 16, 1));
  convert_and_compare(**converter, second, noise_image(32, 16, 2));
  convert_and_compare(**converter, first, noise_image(32, 16, 3));
}

TEST_F(YuvConverterTest, RefusesSizesAndImagesThatItCannotRead) {
  for (const auto& [width, height] : {std::pair{0u, 2u}, {8u, 0u}, {12u, 2u}, {8u, 3u}})
    EXPECT_EQ(YuvConverter::create(*device_, width, height).status().code(),
              absl::StatusCode::kInvalidArgument);
  auto converter = YuvConverter::create(*device_, 32, 16);
  ASSERT_TRUE(converter.ok()) << converter.status();
  gpu::Commands commands = device_->begin();
  const gpu::Image images[] = {image(32, 32, Format::rgba8_srgb), image(32, 16, Format::rgba8_srgb, false),
                               image(32, 16, Format::rgba16_float)};
  for (const gpu::Image& wrong : images)
    EXPECT_EQ((*converter)->record(commands, wrong).code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace tessera::codec
