#include "transport/pacer.h"

#include <gtest/gtest.h>

#include <numeric>
#include <random>

namespace tessera::transport {
namespace {

std::vector<PacedPacket> frame(std::initializer_list<size_t> sizes) {
  std::vector<PacedPacket> out;
  for (size_t bytes : sizes) out.push_back({.bytes = Datagram(bytes, 1)});
  return out;
}

struct Sent {
  TimeNs at;
  size_t bytes;
};

// Over every window that begins with one datagram and ends with another: the bound of the token bucket.
void expect_rate(const std::vector<Sent>& sent, double rate_bps, size_t burst_bytes) {
  for (size_t first = 0; first < sent.size(); ++first) {
    size_t bytes = 0;
    for (size_t last = first; last < std::min(sent.size(), first + 300); ++last) {
      bytes += sent[last].bytes + Pacer::kIpUdpBytes;
      const double most =
          static_cast<double>(burst_bytes) + rate_bps / 8 * to_seconds(sent[last].at - sent[first].at);
      ASSERT_LE(static_cast<double>(bytes), most + 1e-3) << first << ".." << last;
    }
  }
}

TEST(Pacer, NeverExceedsItsRateOverAnyWindow) {
  std::mt19937 random(1);
  for (double rate : {1e6, 20e6, 333e6}) {
    for (size_t burst : {1228u, 3000u, 20'000u}) {
      Pacer pacer({.rate_bps = rate, .burst_bytes = burst, .max_queued_bytes = 1 << 20});
      std::vector<Sent> sent;
      TimeNs now = 0;
      for (int i = 0; i < 400; ++i) {
        if (random() % 4 == 0) {
          std::vector<PacedPacket> packets(random() % 20);
          for (PacedPacket& p : packets) p.bytes.resize(50 + random() % 1150);
          (void)pacer.enqueue_frame(std::move(packets));
        }
        if (random() % 8 == 0)
          pacer.enqueue_retransmission({.bytes = Datagram(1000), .retransmission = true});
        // Now as the timer says, now late, now too early.
        const auto next = pacer.next_event_ns();
        now = std::max(now,
                       random() % 3 == 0 || !next ? now + static_cast<TimeNs>(random() % 5'000'000) : *next);
        for (const PacedPacket& p : pacer.poll(now)) sent.push_back({now, p.bytes.size()});
      }
      ASSERT_GT(sent.size(), 300u);
      expect_rate(sent, rate, burst);
    }
  }
}

// The other side of it: a full queue drains at the rate, and the timer's times are enough to drain it.
TEST(Pacer, IsNotSlowerThanItsRate) {
  Pacer pacer({.rate_bps = 8e6, .burst_bytes = 1500});
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(pacer.enqueue_frame(frame({972, 972})).ok());
  EXPECT_EQ(pacer.queued_bytes(), 200'000u);
  EXPECT_EQ(pacer.queued_ns(), 200 * kNsPerMs);
  TimeNs now = 0;
  size_t packets = 0;
  while (const auto next = pacer.next_event_ns()) {
    now = std::max(now, *next);
    packets += pacer.poll(now).size();
  }
  EXPECT_EQ(packets, 200u);
  EXPECT_NEAR(to_ms(now), 199, 1);
}

TEST(Pacer, RetransmissionsGoFirstAndFramesKeepTheirOrder) {
  Pacer pacer({.rate_bps = 1e6, .burst_bytes = 1500});
  std::vector<PacedPacket> packets = frame({1000, 1000, 1000});
  for (size_t i = 0; i < 3; ++i) packets[i].sequence = static_cast<ExtendedSequence>(i);
  ASSERT_TRUE(pacer.enqueue_frame(std::move(packets)).ok());
  ASSERT_TRUE(pacer.enqueue_retransmission({.bytes = Datagram(500), .sequence = 77, .retransmission = true}));
  std::vector<ExtendedSequence> order;
  for (TimeNs now = 0; pacer.queued_bytes() > 0; now += kNsPerMs) {
    for (const PacedPacket& p : pacer.poll(now)) order.push_back(p.sequence);
  }
  EXPECT_EQ(order, (std::vector<ExtendedSequence>{77, 0, 1, 2}));
}

TEST(Pacer, TakesFramesWholeOrNotAtAll) {
  Pacer pacer({.rate_bps = 1e6, .max_queued_bytes = 5000});
  ASSERT_TRUE(pacer.enqueue_frame(frame({1000, 1000, 1000})).ok());
  const size_t before = pacer.queued_bytes();
  const Status refused = pacer.enqueue_frame(frame({1000, 1000}));
  EXPECT_EQ(refused.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_NE(refused.message().find("max_queued_bytes (5000)"), std::string::npos) << refused;
  EXPECT_EQ(pacer.queued_bytes(), before);
  EXPECT_TRUE(pacer.enqueue_frame(frame({1000})).ok());
}

TEST(Pacer, RetransmissionsAreBounded) {
  Pacer pacer({.rate_bps = 1e6, .max_retransmission_bytes = 5000});
  int taken = 0;
  for (int i = 0; i < 100; ++i)
    taken += pacer.enqueue_retransmission({.bytes = Datagram(1000), .retransmission = true});
  EXPECT_EQ(taken, 4);
}

TEST(Pacer, TheBudgetIsWhatLeavesWithinTheFrameInterval) {
  Pacer pacer({.rate_bps = 24e6});
  const DurationNs interval = kNsPerSecond / 30;
  EXPECT_NEAR(pacer.frame_budget_bits(interval, false), 800'000, 1);
  EXPECT_NEAR(pacer.frame_budget_bits(interval, true), 3'200'000, 1);
  std::vector<PacedPacket> packets;
  for (int i = 0; i < 100; ++i) packets.push_back({.bytes = Datagram(972)});
  ASSERT_TRUE(pacer.enqueue_frame(std::move(packets)).ok());  // 800'000 bits
  EXPECT_NEAR(pacer.frame_budget_bits(interval, false), 0, 1);
  EXPECT_NEAR(pacer.frame_budget_bits(interval, true), 2'400'000, 2);
}

}  // namespace
}  // namespace tessera::transport
