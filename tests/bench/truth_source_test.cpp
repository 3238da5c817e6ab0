#include "bench/truth_source.h"

#include <gtest/gtest.h>

#include "scene/procedural.h"

namespace tessera::bench {
namespace {

class TruthSourceTest : public testing::Test {
 protected:
  void SetUp() override {
    auto device = gpu::Device::create({.select = "cpu"});
    ASSERT_TRUE(device.ok()) << device.status();
    const auto scene = scene::make_gallery(0);
    auto shared = server::SharedScene::create(*device, scene);
    ASSERT_TRUE(shared.ok()) << shared.status();
    auto source = TruthSource::create(*shared, "gallery:0", "none", 4);
    ASSERT_TRUE(source.ok()) << source.status();
    source_ = *std::move(source);
    view_.width = 64;
    view_.height = 36;
  }
  RenderedImage render(const View& view, shading::ReferenceRequest request, TimeNs time = 0) {
    const auto image = source_->render(view, time, request);
    EXPECT_TRUE(image.ok()) << image.status();
    return *image;
  }

  std::unique_ptr<TruthSource> source_;
  View view_;
};

TEST_F(TruthSourceTest, APictureThatTheTruthHasIsNotRenderedAgain) {
  const auto truth = source_->truth(view_, 0);
  ASSERT_TRUE(truth.ok()) << truth.status();
  EXPECT_EQ(render(view_, {}), *truth);
  EXPECT_NE(render(view_, {.samples = 1}), *truth);
  View other = view_;
  other.pose.position.x += 1e-12;
  EXPECT_NE(render(other, {}), *truth);
  EXPECT_NE(render(view_, {}, kNsPerSecond), *truth) << "the gallery moves";
}

TEST_F(TruthSourceTest, APlaneThatIsMissingIsRendered) {
  const RenderedImage without = render(view_, {});
  const RenderedImage with_depth = render(view_, {.depth = true});
  EXPECT_TRUE(without->depth.empty());
  EXPECT_FALSE(with_depth->depth.empty());
  EXPECT_EQ(with_depth->color.rgba, without->color.rgba);
}

}  // namespace
}  // namespace tessera::bench
