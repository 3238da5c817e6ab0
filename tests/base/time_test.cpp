#include "base/time.h"

#include <gtest/gtest.h>

#include "base/frame_number.h"

namespace tessera {
namespace {

TEST(Time, ConversionsRoundToTheNearestNanosecond) {
  EXPECT_EQ(from_seconds(1.0), kNsPerSecond);
  EXPECT_EQ(from_seconds(-1.0), -kNsPerSecond);
  EXPECT_EQ(from_ms(33.3), 33'300'000);
  EXPECT_EQ(from_seconds(0.3e-9), 0);
  EXPECT_EQ(from_seconds(0.7e-9), 1);
  EXPECT_EQ(from_seconds(-0.7e-9), -1);
  EXPECT_DOUBLE_EQ(to_ms(from_ms(12.5)), 12.5);
  for (int frame = 0; frame < 10000; ++frame) {
    const double seconds = frame / 60.0;
    EXPECT_NEAR(to_seconds(from_seconds(seconds)), seconds, 1e-9);
  }
}

TEST(Time, SteadyClockDoesNotRunBackwards) {
  const SteadyClock clock;
  TimeNs last = clock.now();
  for (int i = 0; i < 1000; ++i) {
    const TimeNs now = clock.now();
    ASSERT_GE(now, last);
    last = now;
  }
}

TEST(Time, VirtualClockMovesForwardOnlyAndOnlyWhenTold) {
  VirtualClock clock;
  EXPECT_EQ(clock.now(), 0);
  clock.advance_to(100);
  EXPECT_EQ(clock.now(), 100);
  clock.advance_to(50);
  EXPECT_EQ(clock.now(), 100);
  clock.advance_to(-1);
  EXPECT_EQ(clock.now(), 100);
}

TEST(FrameNumber, OrderIsCorrectAcrossTheWrap) {
  EXPECT_TRUE(is_newer(1, 0));
  EXPECT_FALSE(is_newer(0, 1));
  EXPECT_FALSE(is_newer(7, 7));
  EXPECT_TRUE(is_newer(0, 0xffffffffu));
  EXPECT_FALSE(is_newer(0xffffffffu, 0));
  for (const FrameNumber start : {0u, 1u, 0x7fffffffu, 0x80000000u, 0xfffffff0u, 0xffffffffu}) {
    for (const FrameNumber distance : {1u, 2u, 1000u, 0x7fffffffu}) {
      EXPECT_TRUE(is_newer(start + distance, start));
      EXPECT_FALSE(is_newer(start, start + distance));
    }
  }
}

}  // namespace
}  // namespace tessera
