#include "server/rate_split.h"

#include <gtest/gtest.h>

namespace tessera::server {
namespace {

constexpr RateSplit kSplit{.bitrate_bps = 18e6, .frames_per_second = 30};

TEST(RateSplit, AtlasGetsWhatGeometryLeaves) {
  EXPECT_DOUBLE_EQ(kSplit.frame_bits(), 600e3);
  EXPECT_DOUBLE_EQ(kSplit.atlas_bits(0, false), 600e3);
  EXPECT_DOUBLE_EQ(kSplit.atlas_bits(100e3, false), 500e3);
}

TEST(RateSplit, AtlasKeepsItsFloor) {
  for (double meta = 0; meta < 1e7; meta += 12345) {
    for (const bool key : {false, true})
      EXPECT_GE(kSplit.atlas_bits(meta, key), 0.25 * kSplit.atlas_bits(0, key));
  }
}

TEST(RateSplit, KeyFrameMayTakeFourBudgets) {
  EXPECT_DOUBLE_EQ(kSplit.atlas_bits(0, true), 4 * 600e3);
}

// A server that falls behind its rate sends better frames, not an idle link.
TEST(RateSplit, FramesFurtherApartGetMoreBitsUpToAKeyFrames) {
  const auto at = [](double periods) { return kSplit.at_interval(from_seconds(periods / 30)); };
  for (const double periods : {0.0, 0.5, 1.0, 2.0}) {
    EXPECT_NEAR(at(periods).atlas_bits(0, false), kSplit.atlas_bits(0, false), 1) << periods;
  }
  EXPECT_NEAR(at(5).atlas_bits(0, false), 2.5 * 600e3, 1);
  EXPECT_NEAR(at(8).atlas_bits(0, false), 4 * 600e3, 1);
  EXPECT_NEAR(at(1000).atlas_bits(0, false), 4 * 600e3, 1);
  for (const double periods : {1.0, 5.0, 100.0}) EXPECT_NEAR(at(periods).atlas_bits(0, true), 4 * 600e3, 1);
}

TEST(RateSplit, SkipsAFrameWhileTheNetworkHoldsMoreThanOne) {
  EXPECT_TRUE(kSplit.may_render(0));
  EXPECT_TRUE(kSplit.may_render(from_seconds(1.0 / 30)));
  EXPECT_FALSE(kSplit.may_render(from_seconds(1.01 / 30)));
}

}  // namespace
}  // namespace tessera::server
