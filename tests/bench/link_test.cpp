#include "bench/link.h"

#include <gtest/gtest.h>

#include <numeric>

namespace tessera::bench {
namespace {

std::vector<uint8_t> bytes(size_t n, uint8_t value = 0) {
  return std::vector<uint8_t>(n, value);
}

// Polls at every event until nothing is under way.
std::vector<Delivery> drain(Link& link) {
  std::vector<Delivery> all;
  while (const auto next = link.next_event_ns()) {
    for (Delivery& d : link.poll(*next)) all.push_back(std::move(d));
  }
  return all;
}

TEST(Link, RateAndDelayAddUp) {
  Link link({.rate_bps = 8e6, .delay_ns = from_ms(50)});  // 1 byte a microsecond
  link.send(from_ms(10), Channel::atlas, bytes(5000, 42));
  ASSERT_EQ(link.next_event_ns(), from_ms(10 + 5 + 50));
  EXPECT_TRUE(link.poll(from_ms(65) - 1).empty());
  const auto delivered = link.poll(from_ms(65));
  ASSERT_EQ(delivered.size(), 1u);
  EXPECT_EQ(delivered[0].delivered_ns, from_ms(65));
  EXPECT_EQ(delivered[0].sent_ns, from_ms(10));
  EXPECT_EQ(delivered[0].payload, bytes(5000, 42));
  EXPECT_EQ(link.next_event_ns(), std::nullopt);
  EXPECT_EQ(link.stats().datagrams, 5u);
  EXPECT_EQ(link.stats().bytes_on_wire, 5000u);
}

TEST(Link, MessagesShareTheBottleneck) {
  Link link({.rate_bps = 8e6});
  for (int i = 0; i < 10; ++i) link.send(0, Channel::atlas, bytes(1000));
  EXPECT_EQ(link.queued_ns(0), from_ms(10));
  EXPECT_EQ(link.queued_bytes(0), 10000u);
  EXPECT_EQ(link.queued_bytes(from_ms(4)), 6000u);
  EXPECT_EQ(link.queued_bytes(from_ms(11)), 0u);
  const auto all = drain(link);
  ASSERT_EQ(all.size(), 10u);
  for (int i = 0; i < 10; ++i) EXPECT_EQ(all[i].delivered_ns, from_ms(i + 1));
}

TEST(Link, AnIdleLinkHasNoQueue) {
  Link link({.rate_bps = 8e6});
  link.send(0, Channel::meta, bytes(1000));
  link.send(from_ms(100), Channel::meta, bytes(1000));
  const auto all = drain(link);
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all[1].delivered_ns, from_ms(101));
}

TEST(Link, AnEmptyMessageIsDelivered) {
  Link link({.rate_bps = 8e6, .delay_ns = 7});
  link.send(5, Channel::meta, {});
  const auto all = drain(link);
  ASSERT_EQ(all.size(), 1u);
  EXPECT_EQ(all[0].delivered_ns, 12);
}

TEST(Link, AnUnlimitedLinkOnlyDelays) {
  Link link({.delay_ns = from_ms(50)});
  link.send(0, Channel::atlas, bytes(10'000'000));
  EXPECT_EQ(link.queued_bytes(0), 0u);
  EXPECT_EQ(link.next_event_ns(), from_ms(50));
}

TEST(Link, JitterStaysInItsBoundsAndUsesThem) {
  Link link({.delay_ns = from_ms(50), .jitter_ns = from_ms(20)});
  for (int i = 0; i < 2000; ++i) link.send(from_ms(i), Channel::atlas, bytes(100));
  double sum = 0;
  DurationNs least = INT64_MAX, most = 0;
  for (const Delivery& d : drain(link)) {
    const DurationNs delay = d.delivered_ns - d.sent_ns;
    least = std::min(least, delay);
    most = std::max(most, delay);
    sum += to_ms(delay) / 2000;
  }
  EXPECT_GE(least, from_ms(30));
  EXPECT_LE(most, from_ms(70));
  EXPECT_LT(least, from_ms(31));
  EXPECT_GT(most, from_ms(69));
  EXPECT_NEAR(sum, 50, 1.3);  // five standard errors of a uniform ±20
}

TEST(Link, JitterNeverMakesTimeRunBackwards) {
  Link link({.delay_ns = from_ms(1), .jitter_ns = from_ms(20)});
  for (int i = 0; i < 500; ++i) link.send(from_ms(i), Channel::atlas, bytes(100));
  for (const Delivery& d : drain(link)) EXPECT_GE(d.delivered_ns, d.sent_ns);
}

TEST(Link, MetaKeepsItsOrderAndAtlasDoesNot) {
  Link link({.delay_ns = from_ms(50), .jitter_ns = from_ms(30), .loss = 0.1, .seed = 3});
  for (int i = 0; i < 500; ++i) {
    link.send(from_ms(i), Channel::meta, bytes(3000));
    link.send(from_ms(i), Channel::atlas, bytes(3000));
  }
  std::vector<uint64_t> meta, atlas;
  TimeNs last = 0;
  for (const Delivery& d : drain(link)) {
    EXPECT_GE(d.delivered_ns, last);
    last = d.delivered_ns;
    (d.channel == Channel::meta ? meta : atlas).push_back(d.id);
  }
  EXPECT_EQ(meta.size(), 500u);
  EXPECT_EQ(atlas.size(), 500u);
  EXPECT_TRUE(std::is_sorted(meta.begin(), meta.end()));
  EXPECT_FALSE(std::is_sorted(atlas.begin(), atlas.end()));
}

TEST(Link, LostDatagramsComeOneRoundTripLater) {
  const DurationNs delay = from_ms(40);
  Link link({.delay_ns = delay, .loss = 0.2, .seed = 9});
  for (int i = 0; i < 5000; ++i) link.send(from_ms(i), Channel::atlas, bytes(500));
  std::map<DurationNs, int> tries;  // round trips waited → messages
  const auto all = drain(link);
  EXPECT_EQ(all.size(), 5000u);
  for (const Delivery& d : all) {
    const DurationNs late = d.delivered_ns - d.sent_ns - delay;
    ASSERT_EQ(late % (2 * delay), 0);
    ++tries[late / (2 * delay)];
  }
  const double lost =
      static_cast<double>(link.stats().datagrams_lost) / static_cast<double>(link.stats().datagrams);
  EXPECT_NEAR(lost, 0.2, 0.03);      // five standard errors
  EXPECT_NEAR(tries[0], 4000, 142);  // 5000 * 0.8
  EXPECT_NEAR(tries[1], 800, 130);   // 5000 * 0.2 * 0.8
  EXPECT_GT(tries[2], 0);
}

TEST(Link, RetransmissionsPayForTheirBytes) {
  Link link({.rate_bps = 8e6, .loss = 0.3, .seed = 4});
  link.send(0, Channel::atlas, bytes(1'200'000));
  drain(link);
  EXPECT_EQ(link.stats().bytes_on_wire, link.stats().datagrams * Link::kDatagramBytes);
  EXPECT_EQ(link.stats().datagrams, 1000 + link.stats().datagrams_lost);
}

TEST(Link, TheSameSeedGivesTheSameDeliveries) {
  const auto run = [](uint64_t seed) {
    Link link(
        {.rate_bps = 5e6, .delay_ns = from_ms(20), .jitter_ns = from_ms(9), .loss = 0.05, .seed = seed});
    for (int i = 0; i < 200; ++i)
      link.send(from_ms(5 * i), i % 3 ? Channel::atlas : Channel::meta, bytes(10 + 37 * i));
    std::vector<std::pair<uint64_t, TimeNs>> log;
    for (const Delivery& d : drain(link)) log.emplace_back(d.id, d.delivered_ns);
    return log;
  };
  EXPECT_EQ(run(1), run(1));
  EXPECT_NE(run(1), run(2));
}

}  // namespace
}  // namespace tessera::bench
