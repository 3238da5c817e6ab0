#include "transport/clock_offset.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace tessera::transport {
namespace {

TEST(ClockOffset, NothingBeforeTheFirstExchange) {
  ClockOffset clock;
  EXPECT_FALSE(clock.offset_ns());
  EXPECT_EQ(clock.to_server(5), 5);
}

// One exchange by hand: 10 there, 20 back, 7 in between; the server is 1000 ahead.
TEST(ClockOffset, OneExchange) {
  ClockOffset clock;
  ASSERT_TRUE(clock.on_pong(137, {1, 100, 1110, 1117}));
  EXPECT_EQ(clock.round_trip_ns(), 30);
  EXPECT_EQ(clock.offset_ns(), 995);  // off by half of the asymmetry
}

TEST(ClockOffset, TheShortestRoundTripWins) {
  std::mt19937_64 random(1);
  for (DurationNs offset : {-5 * kNsPerSecond, DurationNs{0}, 123'456'789 * kNsPerSecond}) {
    ClockOffset clock;
    std::exponential_distribution<double> queueing(1.0 / 20);  // mean 20 ms each way on 5 ms of path
    TimeNs now = 0;
    for (int i = 0; i < 200; ++i) {
      now += 250 * kNsPerMs;
      const DurationNs there = from_ms(5 + queueing(random)), back = from_ms(5 + queueing(random));
      ASSERT_TRUE(clock.on_pong(now + there + kNsPerMs + back,
                                {0, now, now + there + offset, now + there + offset + kNsPerMs}));
      ASSERT_LE(std::abs(*clock.offset_ns() - offset), *clock.round_trip_ns() / 2 + 1);
    }
    EXPECT_LT(std::abs(*clock.offset_ns() - offset), from_ms(6));
  }
}

TEST(ClockOffset, OldExchangesAreForgotten) {
  ClockOffset clock;
  ASSERT_TRUE(clock.on_pong(10, {0, 0, 5, 5}));
  ASSERT_TRUE(clock.on_pong(40 * kNsPerSecond + 100,
                            {0, 40 * kNsPerSecond, 40 * kNsPerSecond + 1050, 40 * kNsPerSecond + 1050}));
  EXPECT_EQ(clock.offset_ns(), 1000);
}

TEST(ClockOffset, ContradictionsAndExtremesAreRefused) {
  ClockOffset clock;
  EXPECT_FALSE(clock.on_pong(10, {0, 20, 5, 5}));   // received before it was sent
  EXPECT_FALSE(clock.on_pong(10, {0, 0, 5, 4}));    // answered before it came
  EXPECT_FALSE(clock.on_pong(10, {0, 0, 5, 100}));  // longer there than the whole trip
  EXPECT_FALSE(clock.on_pong(10, {0, INT64_MIN, 5, 5}));
  EXPECT_FALSE(clock.on_pong(10, {0, 0, INT64_MAX, INT64_MAX}));
  EXPECT_FALSE(clock.offset_ns());
}

}  // namespace
}  // namespace tessera::transport
