#include "bench/mesh_warp.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "test_images.h"

namespace tessera::bench {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr uint32_t kWidth = 64, kHeight = 36;
constexpr uint8_t kBackground[3] = {1, 2, 3};

View test_view() {
  View view;
  view.fov = {-1, 1, -0.5625f, 0.5625f};
  view.width = kWidth;
  view.height = kHeight;
  return view;
}

Image8 smooth_image() {
  return make_image(kWidth, kHeight, [](uint32_t x, uint32_t y, uint32_t c) {
    return 128 + 100 * std::sin(0.15 * x + c) * std::cos(0.2 * y + 2 * c);
  });
}

class MeshWarpTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    auto device = gpu::Device::create({.select = "cpu", .validation = true});
    ASSERT_TRUE(device.ok()) << device.status();
    device_ = *device;
    auto warp = MeshWarp::create(*device_, kWidth, kHeight, kWidth, kHeight, kBackground);
    ASSERT_TRUE(warp.ok()) << warp.status();
    warp_ = *std::move(warp);
  }
  static void TearDownTestSuite() {
    warp_.reset();
    EXPECT_EQ(device_->validation_messages(), 0u);
    device_.reset();
  }

  static Image8 warp(const Image8& color, const std::vector<float>& depth, const View& target) {
    const Status set = warp_->set_source(test_view(), color, depth);
    EXPECT_TRUE(set.ok()) << set;
    auto image = warp_->draw(target);
    EXPECT_TRUE(image.ok()) << image.status();
    return image.ok() ? *std::move(image) : Image8(kWidth, kHeight);
  }

  static std::shared_ptr<gpu::Device> device_;
  static std::unique_ptr<MeshWarp> warp_;
};

std::shared_ptr<gpu::Device> MeshWarpTest::device_;
std::unique_ptr<MeshWarp> MeshWarpTest::warp_;

int largest_difference(const Image8& a, const Image8& b) {
  int largest = 0;
  for (size_t i = 0; i < a.rgba.size(); ++i) largest = std::max(largest, std::abs(a.rgba[i] - b.rgba[i]));
  return largest;
}

TEST_F(MeshWarpTest, TheSameViewGivesTheSamePicture) {
  const Image8 color = textured(kWidth, kHeight);
  std::vector<float> depth(kWidth * kHeight);
  for (uint32_t i = 0; i < depth.size(); ++i)
    depth[i] = i % 11 ? 0.3f + static_cast<float>(i * 37 % 101) : kInfinity;
  EXPECT_LE(largest_difference(warp(color, depth, test_view()), color), 2);
}

TEST_F(MeshWarpTest, InfinitelyFarThingsDoNotMoveWithTheEye) {
  const Image8 color = smooth_image();
  View target = test_view();
  target.pose.position = {5, -3, 2};
  EXPECT_LE(largest_difference(warp(color, std::vector<float>(kWidth * kHeight, kInfinity), target), color),
            2);
}

TEST_F(MeshWarpTest, ARotationResamplesTheSource) {
  const Image8 color = smooth_image();
  const double angle = 0.1;  // to the left, about +Y
  View target = test_view();
  target.pose.orientation = glm::angleAxis(angle, dvec3(0, 1, 0));
  const Image8 shown = warp(color, std::vector<float>(kWidth * kHeight, 50.0f), target);
  for (uint32_t y = 4; y < kHeight - 4; ++y) {
    for (uint32_t x = 10; x < kWidth - 2; ++x) {
      const dvec3 ray(2 * (x + 0.5) / kWidth - 1, 0.5625 * (1 - 2 * (y + 0.5) / kHeight), -1);
      const dvec3 in_source = target.pose.orientation * ray;
      const double u = (in_source.x / -in_source.z + 1) / 2 * kWidth - 0.5;
      const double v = (1 - in_source.y / -in_source.z / 0.5625) / 2 * kHeight - 0.5;
      if (u < 1 || v < 1 || u > kWidth - 2 || v > kHeight - 2) continue;
      for (uint32_t c = 0; c < 3; ++c) {
        const double expected = 128 + 100 * std::sin(0.15 * u + c) * std::cos(0.2 * v + 2 * c);
        ASSERT_NEAR(shown.at(x, y)[c], expected, 4) << x << ',' << y;
      }
    }
  }
}

// A near wall on the left half (red, 1 m), a far one on the right (green, 10 m).
struct TwoWalls {
  Image8 color = make_image(kWidth, kHeight, [](uint32_t x, uint32_t, uint32_t c) {
    return c == (x < kWidth / 2 ? 0u : 1u) ? 255 : 0;
  });
  std::vector<float> depth = std::vector<float>(kWidth * kHeight);
  TwoWalls() {
    for (uint32_t i = 0; i < depth.size(); ++i) depth[i] = i % kWidth < kWidth / 2 ? 1.0f : 10.0f;
  }
};

TEST_F(MeshWarpTest, ADisocclusionStretches) {
  const TwoWalls walls;
  View target = test_view();
  target.pose.position.x = 0.5;  // the near wall moves 16 px to the left, the far one 1.6 px
  const Image8 shown = warp(walls.color, walls.depth, target);
  uint32_t mixed = 0;
  int last_green = 0;
  for (uint32_t x = 0; x < kWidth - 3; ++x) {
    const uint8_t* p = shown.at(x, kHeight / 2);
    EXPECT_NEAR(p[0] + p[1], 255, 3) << x;  // a mixture of both walls, never the background
    EXPECT_GE(p[1], last_green) << x;
    last_green = p[1];
    mixed += p[0] > 5 && p[1] > 5;
  }
  EXPECT_NEAR(mixed, 14, 2);
}

TEST_F(MeshWarpTest, NearThingsHideFarOnes) {
  const TwoWalls walls;
  View target = test_view();
  target.pose.position.x = -0.5;  // the near wall moves 16 px to the right
  const Image8 shown = warp(walls.color, walls.depth, target);
  EXPECT_TRUE(std::equal(kBackground, kBackground + 3, shown.at(5, 18)));  // left of the source view
  EXPECT_EQ(shown.at(40, 18)[0], 255);
  EXPECT_EQ(shown.at(46, 18)[0], 255);
  EXPECT_EQ(shown.at(52, 18)[1], 255);
}

TEST_F(MeshWarpTest, WrongSizesAreRefused) {
  EXPECT_FALSE(warp_->set_source(test_view(), textured(8, 8), std::vector<float>(64)).ok());
  EXPECT_FALSE(warp_->set_source(test_view(), textured(kWidth, kHeight), std::vector<float>(64)).ok());
  EXPECT_FALSE(MeshWarp::create(*device_, 1, 9, 8, 8, kBackground).ok());
}

TEST(WarpSourceView, IsTwentyPercentWiderAtTheSameResolution) {
  View client;
  client.fov = Fov::symmetric(1.047f, 960.0f / 540);
  client.width = 960;
  client.height = 540;
  const View source = warp_source_view(client);
  EXPECT_NEAR(source.fov.height_rad() / client.fov.height_rad(), 1.2, 1e-4);
  EXPECT_NEAR(source.fov.width_rad() / client.fov.width_rad(), 1.2, 1e-4);
  EXPECT_EQ(source.width % 2, 0u);
  EXPECT_EQ(source.height % 2, 0u);
  EXPECT_NEAR(source.pixels_per_radian() / client.pixels_per_radian(), 1, 0.01);
}

}  // namespace
}  // namespace tessera::bench
