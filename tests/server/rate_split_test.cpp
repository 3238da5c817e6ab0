#include "server/rate_split.h"

#include <gtest/gtest.h>

#include <algorithm>

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

// Encoders that use a share of what they may, geometry of any size.
TEST(BitBalance, TheMeanIsUsedAndKept) {
  constexpr int kFrames = 1000;
  for (const double used : {0.8, 0.85, 0.95, 1.0, 1.05}) {
    BitBalance balance;
    double sum = 0;
    for (int frame = 0; frame < kFrames; ++frame) {
      const double meta = 50e3 + 1e3 * (frame * 37 % 100);
      const double budget = balance.atlas_bits(kSplit, meta, false);
      EXPECT_LE(budget + meta, 1.25 * 600e3 + 1);
      const double bits = used * budget;
      balance.spend(bits);
      sum += meta + bits;
    }
    EXPECT_NEAR(sum / kFrames / kSplit.frame_bits(), BitBalance::kMeanShare, 0.002) << used;
  }
}

// A link of the rate that carries headers, too: without room to drain, what a key frame has left in its queue
// would stay there as latency.
TEST(BitBalance, AQueueDrains) {
  constexpr double kHeaders = 1.04;
  for (const double used : {0.8, 0.9, 1.0}) {
    BitBalance balance;
    double queued = 0;  // bits
    for (int frame = 0; frame < 100; ++frame) {
      const bool key_frame = frame == 0;
      if (kSplit.may_render(from_seconds(queued / kSplit.bitrate_bps))) {
        const double bits = used * balance.atlas_bits(kSplit, 20e3, key_frame);
        balance.spend(bits);
        queued += kHeaders * (20e3 + bits);
      }
      queued = std::max(0.0, queued - kSplit.frame_bits());
    }
    EXPECT_LT(queued, 0.3 * kSplit.frame_bits()) << used;
  }
}

TEST(BitBalance, LateFramesTakeNoMoreThanAKeyFrame) {
  for (const double periods : {2.0, 5.0, 7.0, 8.0, 100.0}) {
    const RateSplit rate = kSplit.at_interval(from_seconds(periods / 30));
    BitBalance balance;
    for (int frame = 0; frame < 10; ++frame) {
      EXPECT_LE(balance.atlas_bits(rate, 0, false), kSplit.atlas_bits(0, true) + 1) << periods;
      balance.spend(0);
    }
  }
}

TEST(BitBalance, AFrameThatNeedsNothingLeavesAQuarterOfAFrameAtMost) {
  BitBalance balance;
  for (int frame = 0; frame < 10; ++frame) {
    balance.atlas_bits(kSplit, 0, false);
    balance.spend(1000);
  }
  EXPECT_DOUBLE_EQ(balance.atlas_bits(kSplit, 0, false), 1.25 * 600e3);
}

TEST(BitBalance, KeyFramesNeitherTakeNorLeaveAny) {
  BitBalance balance;
  balance.atlas_bits(kSplit, 0, false);
  balance.spend(0);
  EXPECT_DOUBLE_EQ(balance.atlas_bits(kSplit, 0, true), kSplit.atlas_bits(0, true));
  balance.spend(0);
  EXPECT_DOUBLE_EQ(balance.atlas_bits(kSplit, 0, false), kSplit.atlas_bits(0, false));
}

TEST(BitBalance, WhatALargerRateLeftDoesNotServeASmallerOne) {
  BitBalance balance;
  balance.atlas_bits(kSplit, 0, false);
  balance.spend(0);
  RateSplit slow = kSplit;
  slow.bitrate_bps /= 100;
  EXPECT_DOUBLE_EQ(balance.atlas_bits(slow, 0, false), 1.25 * 6e3);
}

TEST(BitBalance, GeometryThatTookTooMuchIsPaidBackDownToTheFloor) {
  BitBalance balance;
  EXPECT_DOUBLE_EQ(balance.atlas_bits(kSplit, 2e6, false), 0.25 * 600e3);
  balance.spend(0.25 * 600e3);
  EXPECT_DOUBLE_EQ(balance.atlas_bits(kSplit, 0, false), 0.75 * 600e3);
  balance.spend(600e3);
  EXPECT_DOUBLE_EQ(balance.atlas_bits(kSplit, 400e3, false), 0.25 * 600e3);
}

}  // namespace
}  // namespace tessera::server
