#include "transport/receiver_statistics.h"

#include <gtest/gtest.h>

#include "transport/ntp_time.h"

namespace tessera::transport {
namespace {

using Verdict = ReceiverStatistics::Verdict;

void feed(ReceiverStatistics& s, uint16_t first, int count, int lose_every = 0) {
  for (int i = 0; i < count; ++i) {
    if (lose_every > 0 && i % lose_every == lose_every - 1 && i + 1 < count) continue;
    ASSERT_EQ(s.on_packet(0, static_cast<uint16_t>(first + i), 0), Verdict::valid);
  }
}

// RFC 3550 section 6.4.4, the example of round-trip computation:
// sent at 0xb44db705.20000000, received with A = 0xb710:8000, LSR = 0xb705:2000, DLSR = 0x0005:4000, so 6.125
// s.
TEST(NtpTime, TheExampleOfTheRfc) {
  EXPECT_EQ(middle_32(0xb44db70520000000), 0xb7052000u);
  EXPECT_EQ(0xb7108000u - 0xb7052000u - 0x00054000u, 0x00062000u);
  EXPECT_EQ(from_compact_ntp(0x00062000), 6'125 * kNsPerMs);
  EXPECT_EQ(compact_ntp(5'250 * kNsPerMs), 0x00054000u);
}

TEST(NtpTime, SecondsAndFractions) {
  EXPECT_EQ(ntp_from(0), 0u);
  EXPECT_EQ(ntp_from(kNsPerSecond), uint64_t{1} << 32);
  EXPECT_EQ(ntp_from(1'500 * kNsPerMs), 0x180000000u);
  EXPECT_EQ(ticks_from(kNsPerSecond, 90'000), 90'000u);
  EXPECT_EQ(ticks_from(100'000 * kNsPerSecond, 90'000), static_cast<uint32_t>(9'000'000'000));  // wrapped
}

TEST(ReceiverStatistics, NothingBeforeTheFirstPacket) {
  EXPECT_FALSE(ReceiverStatistics(1).make_report(0).has_value());
}

// A.3 by hand: 100 expected, 10 lost: 10 * 256 / 100 = 25; then 100 without loss.
TEST(ReceiverStatistics, FractionIsOfTheIntervalAndTheSumOfAll) {
  ReceiverStatistics s(7);
  feed(s, 65'500, 101, 10);
  auto report = s.make_report(0);
  ASSERT_TRUE(report);
  EXPECT_EQ(report->ssrc, 7u);
  EXPECT_EQ(report->fraction_lost, 10 * 256 / 101);
  EXPECT_EQ(report->cumulative_lost, 10);
  EXPECT_EQ(report->highest_sequence, 65'600u);  // one cycle and 64
  feed(s, 65, 100);
  report = s.make_report(0);
  EXPECT_EQ(report->fraction_lost, 0);
  EXPECT_EQ(report->cumulative_lost, 10);
  EXPECT_EQ(report->highest_sequence, 65'700u);
}

TEST(ReceiverStatistics, DuplicatesCountAgainstLosses) {
  ReceiverStatistics s(7);
  feed(s, 10, 5);
  s.on_packet(0, 14, 0);
  s.on_packet(0, 14, 0);
  EXPECT_EQ(s.make_report(0)->cumulative_lost, -2);
  EXPECT_EQ(s.make_report(0)->fraction_lost, 0);
}

TEST(ReceiverStatistics, LateFromBeforeTheWrapKeepsTheCycle) {
  ReceiverStatistics s(7);
  for (uint16_t sequence : {65'534, 0, 65'535, 1}) s.on_packet(0, static_cast<uint16_t>(sequence), 0);
  EXPECT_EQ(s.make_report(0)->highest_sequence, 65'537u);
  EXPECT_EQ(s.lost(), 0);
}

TEST(ReceiverStatistics, AStrayIsIgnoredAndARestartBelieved) {
  ReceiverStatistics s(7);
  feed(s, 100, 10);
  EXPECT_EQ(s.on_packet(0, 30'000, 0), Verdict::ignore);
  EXPECT_EQ(s.on_packet(0, 110, 0), Verdict::valid);
  EXPECT_EQ(s.on_packet(0, 40'000, 0), Verdict::ignore);
  EXPECT_EQ(s.on_packet(0, 40'001, 0), Verdict::restarted);
  EXPECT_EQ(s.received(), 1u);
  EXPECT_EQ(s.on_packet(0, 40'002, 0), Verdict::valid);
}

// A.8: J += (|D| - J) / 16. Packets every 10 ms; one is 5 ms (450 ticks) late, the next on time again.
TEST(ReceiverStatistics, JitterIsThatOfTheRfc) {
  ReceiverStatistics s(7);
  uint16_t sequence = 0;
  const auto packet = [&](DurationNs late) {
    const TimeNs sent = sequence * 10 * kNsPerMs;
    s.on_packet(sent + late + 3 * kNsPerMs, sequence++, ticks_from(sent, 90'000) + 12'345);
  };
  for (int i = 0; i < 20; ++i) packet(0);
  EXPECT_EQ(s.jitter(), 0u);
  packet(5 * kNsPerMs);
  EXPECT_EQ(s.jitter(), 450u / 16);
  packet(0);  // 28.125 + (450 - 28.125) / 16 = 54.49
  EXPECT_EQ(s.jitter(), 54u);
}

// A constant |D| is what the jitter converges to, early or late.
TEST(ReceiverStatistics, JitterConverges) {
  ReceiverStatistics s(7);
  for (int i = 0; i < 1000; ++i)
    s.on_packet(i * 10 * kNsPerMs + (i % 2) * 2 * kNsPerMs, static_cast<uint16_t>(i),
                static_cast<uint32_t>(i * 900));
  EXPECT_NEAR(s.jitter(), 180, 2);
}

TEST(ReceiverStatistics, EchoesTheLastSenderReport) {
  ReceiverStatistics s(7);
  feed(s, 1, 2);
  EXPECT_EQ(s.make_report(0)->last_sr, 0u);
  s.on_sender_report(2 * kNsPerSecond, {7, 0xb44db70520000000, 0, 0, 0, {}});
  const auto report = s.make_report(2 * kNsPerSecond + 5'250 * kNsPerMs);
  EXPECT_EQ(report->last_sr, 0xb7052000u);
  EXPECT_EQ(report->delay_since_last_sr, 0x00054000u);
}

}  // namespace
}  // namespace tessera::transport
