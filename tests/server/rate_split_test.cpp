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

TEST(RateSplit, SkipsAFrameWhileTheNetworkHoldsMoreThanOne) {
  EXPECT_TRUE(kSplit.may_render(0));
  EXPECT_TRUE(kSplit.may_render(from_seconds(1.0 / 30)));
  EXPECT_FALSE(kSplit.may_render(from_seconds(1.01 / 30)));
}

}  // namespace
}  // namespace tessera::server
