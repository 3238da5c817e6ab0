#include "transport/nack_generator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tessera::transport {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr NackSettings kSettings{.reorder_wait_ns = 3 * kNsPerMs,
                                 .min_interval_ns = 10 * kNsPerMs,
                                 .max_tries = 3,
                                 .give_up_ns = kNsPerSecond,
                                 .max_missing = 50,
                                 .initial_rtt_ns = 40 * kNsPerMs};

TEST(NackGenerator, AsksOnlyForWhatStaysAway) {
  NackGenerator nack(kSettings);
  nack.on_packet(0, 10);
  nack.on_packet(0, 14);
  nack.on_packet(2 * kNsPerMs, 12);  // merely late
  EXPECT_THAT(nack.poll(2 * kNsPerMs), IsEmpty());
  EXPECT_EQ(nack.next_event_ns(), 3 * kNsPerMs);
  EXPECT_THAT(nack.poll(3 * kNsPerMs), ElementsAre(11, 13));
  EXPECT_THAT(nack.poll(4 * kNsPerMs), IsEmpty());
  EXPECT_EQ(nack.oldest_missing(), 11);
}

TEST(NackGenerator, RepeatsAfterARoundTripAndGivesUp) {
  NackGenerator nack(kSettings);
  nack.on_packet(0, 1);
  nack.on_packet(0, 3);
  std::vector<TimeNs> asked;
  for (TimeNs t = 0; t < kNsPerSecond; t += kNsPerMs) {
    if (!nack.poll(t).empty()) asked.push_back(t / kNsPerMs);
  }
  EXPECT_THAT(asked, ElementsAre(3, 53, 103));  // 5/4 of 40 ms apart
  EXPECT_EQ(nack.given_up(), 1u);
  EXPECT_EQ(nack.oldest_missing(), std::nullopt);
}

TEST(NackGenerator, GivesUpByAgeWhenTriesAreMany) {
  NackSettings settings = kSettings;
  settings.max_tries = 1000;
  NackGenerator nack(settings);
  nack.on_packet(0, 1);
  nack.on_packet(0, 3);
  nack.poll(kNsPerSecond - 1);
  EXPECT_EQ(nack.missing(), 1u);
  nack.poll(kNsPerSecond);
  EXPECT_EQ(nack.missing(), 0u);
}

TEST(NackGenerator, NextEventNeverLiesBehindWhatPollDoes) {
  NackGenerator nack(kSettings);
  nack.on_packet(0, 1);
  nack.on_packet(0, 5);
  TimeNs t = 0;
  int events = 0;
  while (const auto next = nack.next_event_ns()) {
    ASSERT_GT(*next, t);
    EXPECT_THAT(nack.poll(*next - 1), IsEmpty());
    t = *next;
    nack.poll(t);
    ASSERT_LT(++events, 100);
  }
  EXPECT_EQ(nack.given_up(), 3u);
}

TEST(NackGenerator, TooManyMissingAreGivenUpAtOnce) {
  NackGenerator nack(kSettings);
  nack.on_packet(0, 1);
  nack.on_packet(0, 40);
  EXPECT_EQ(nack.missing(), 38u);
  nack.on_packet(0, 60);
  EXPECT_EQ(nack.missing(), 0u);
  EXPECT_EQ(nack.given_up(), 38u + 19u);
}

// From much too small and much too large estimates to the real round trip.
TEST(NackGenerator, LearnsTheRoundTrip) {
  for (DurationNs initial : {5 * kNsPerMs, 100 * kNsPerMs, 900 * kNsPerMs}) {
    NackSettings settings = kSettings;
    settings.initial_rtt_ns = initial;
    settings.max_tries = 100;
    NackGenerator nack(settings);
    TimeNs t = 0;
    ExtendedSequence sequence = 1;
    nack.on_packet(t, sequence);
    for (int i = 0; i < 60; ++i) {
      nack.on_packet(t, sequence += 2);
      TimeNs asked = -1;
      const TimeNs end = t + 304 * kNsPerMs;
      for (; t < end; t += kNsPerMs) {
        if (!nack.poll(t).empty() && asked < 0) asked = t;
        if (asked >= 0 && t >= asked + 300 * kNsPerMs) break;
      }
      nack.on_packet(t, sequence - 1);
    }
    EXPECT_NEAR(to_ms(nack.rtt_ns()), 300, 30) << initial;
  }
}

// On a short way twelve quick requests would be over before a hiccup of a tenth of a second is.
TEST(NackGenerator, RequestsOnAShortWaySpanTheTimeUntilGivingUp) {
  NackGenerator nack({});
  nack.set_rtt(2 * kNsPerMs);
  nack.on_packet(0, 1);
  nack.on_packet(0, 3);
  std::vector<TimeNs> asked;
  for (TimeNs now = 0; nack.missing() > 0; now = *nack.next_event_ns()) {
    if (!nack.poll(now).empty()) asked.push_back(now);
    if (nack.missing() == 0) break;
  }
  ASSERT_EQ(asked.size(), 12u);
  EXPECT_LE(asked[3] - asked[0], 3 * 10 * kNsPerMs) << "the first ones come quickly";
  EXPECT_GE(asked.back(), 300 * kNsPerMs);
  EXPECT_LE(asked.back(), kNsPerSecond);
  EXPECT_EQ(nack.given_up(), 1u);
}

}  // namespace
}  // namespace tessera::transport
