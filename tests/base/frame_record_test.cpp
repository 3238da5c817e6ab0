#include "base/frame_record.h"

#include <gtest/gtest.h>

#include <random>

namespace tessera {
namespace {

constexpr DurationNs kOffset = 1'000'000;

// Every duration another number, the meta decoded last.
FrameRecord known() {
  FrameRecord r{.session = 1, .frame = 7};
  r.pose_sent = 100;
  r.server = {.pose_received = kOffset + 103, .due = kOffset + 105, .render_begin = kOffset + 110};
  r.server.render_end = kOffset + 160;
  r.server.sent = kOffset + 162;
  r.server.visibility = 10, r.server.layout = 11, r.server.shading = 12, r.server.encode = 15;
  r.client = {.frame = 7,
              .atlas_first_packet = 170,
              .atlas_complete = 180,
              .atlas_decode_begin = 181,
              .atlas_decoded = 187,
              .meta_complete = 190,
              .meta_decode_begin = 194,
              .meta_decoded = 199,
              .draw_begin = 210,
              .displayed = 217,
              .clock_offset = kOffset,
              .clock_error = 1};
  return r;
}

TEST(FrameRecord, DurationsAreWhatTheTimesSay) {
  const auto d = durations(known());
  ASSERT_TRUE(d);
  const std::vector<DurationNs> expected{3, 7, 48, 30, 7, 9, 11, 7};
  for (size_t i = 0; i < expected.size(); ++i)
    EXPECT_EQ(d->named()[i].second, expected[i]) << d->named()[i].first;
  EXPECT_FALSE(d->atlas_last);
  EXPECT_EQ(d->end_to_end, 117);
  // 5 late, 2 between the stages, 2 to hand over to the network, 4 until the decoder begins.
  EXPECT_EQ(d->overhead, 13);
  EXPECT_EQ(d->end_to_end - d->sum(), 2);  // between the stages
}

TEST(FrameRecord, TheStreamDecodedLastCounts) {
  FrameRecord r = known();
  r.client.meta_decoded = r.client.atlas_decoded - 3;
  r.client.meta_complete = r.client.meta_decode_begin = r.client.meta_decoded - 2;
  const auto d = durations(r);
  ASSERT_TRUE(d);
  EXPECT_TRUE(d->atlas_last);
  EXPECT_EQ(d->downlink, 20);
  EXPECT_EQ(d->client_wait, 23);
  EXPECT_EQ(d->end_to_end - d->sum(), 2);
}

// An offset that is wrong moves time from one way of the network to the other; the sum stays.
TEST(FrameRecord, AWrongOffsetMovesTimeBetweenTheTwoWaysOnly) {
  const auto right = durations(known());
  std::mt19937 random(3);
  for (int i = 0; i < 100; ++i) {
    FrameRecord r = known();
    const DurationNs wrong = std::uniform_int_distribution<DurationNs>(-1000, 1000)(random);
    r.client.clock_offset += wrong;
    const auto d = durations(r);
    EXPECT_EQ(d->pose_uplink, right->pose_uplink - wrong);
    EXPECT_EQ(d->downlink, right->downlink + wrong);
    EXPECT_EQ(d->sum(), right->sum());
    EXPECT_EQ(d->overhead, right->overhead);
  }
}

TEST(FrameRecord, AFrameWithoutAllItsTimesHasNoDurations) {
  for (TimeNs ClientFrameTimes::*missing :
       {&ClientFrameTimes::atlas_decoded, &ClientFrameTimes::meta_decoded, &ClientFrameTimes::displayed}) {
    FrameRecord r = known();
    r.client.*missing = 0;
    EXPECT_FALSE(durations(r));
  }
  FrameRecord r = known();
  r.client.clock_error = -1;
  EXPECT_FALSE(durations(r));
  EXPECT_FALSE(durations({}));
}

// A frame that began before it was due, or whose pose came after that, was not late.
TEST(FrameRecord, WaitingForTheFramesTimeIsNoOverhead) {
  FrameRecord r = known();
  const DurationNs base = durations(r)->overhead;
  r.server.due = r.server.render_begin + 4;
  EXPECT_EQ(durations(r)->overhead, base - 5);
  r.server.due = 0;
  r.server.pose_received = r.server.render_begin - 1;
  EXPECT_EQ(durations(r)->overhead, base - 4);
}

}  // namespace
}  // namespace tessera
