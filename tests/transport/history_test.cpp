#include <gtest/gtest.h>

#include "transport/retransmission_history.h"

namespace tessera::transport {
namespace {

Datagram packet(size_t bytes, uint8_t tag) {
  return Datagram(bytes, tag);
}

TEST(RetransmissionHistory, GivesWhatItHasAndThrottlesRepeats) {
  RetransmissionHistory history({});
  for (int i = 0; i < 10; ++i) history.add(0, 65'530 + i, packet(100, static_cast<uint8_t>(i)));
  const auto found = history.take(kNsPerMs, 1, kNsPerMs);  // 65537, wrapped
  ASSERT_TRUE(found);
  EXPECT_EQ((*found)[0], 7);
  EXPECT_FALSE(history.take(kNsPerMs, 1, kNsPerMs));
  EXPECT_TRUE(history.take(2 * kNsPerMs, 1, kNsPerMs));
  EXPECT_FALSE(history.take(2 * kNsPerMs, 4, 0));       // never sent
  EXPECT_FALSE(history.take(2 * kNsPerMs, 65'529, 0));  // likewise
}

TEST(RetransmissionHistory, IsBoundedByBytesAgeAndCount) {
  RetransmissionHistory by_bytes({.max_bytes = 1000});
  for (int i = 0; i < 100; ++i) {
    by_bytes.add(0, i, packet(90, 0));
    EXPECT_LE(by_bytes.bytes(), 1000u);
  }
  EXPECT_EQ(by_bytes.packets(), 11u);
  EXPECT_FALSE(by_bytes.take(0, 88, 0));
  EXPECT_TRUE(by_bytes.take(0, 89, 0));
  by_bytes.add(0, 100, packet(2000, 0));
  EXPECT_EQ(by_bytes.bytes(), 0u);

  RetransmissionHistory by_age({.max_age_ns = kNsPerSecond});
  by_age.add(0, 1, packet(1, 0));
  by_age.add(kNsPerSecond, 2, packet(1, 0));
  EXPECT_TRUE(by_age.take(kNsPerSecond, 1, 0));
  EXPECT_FALSE(by_age.take(kNsPerSecond + 1, 1, 0));
  EXPECT_EQ(by_age.packets(), 1u);

  RetransmissionHistory by_count({.max_bytes = SIZE_MAX});
  for (int i = 0; i < 100'000; ++i) by_count.add(0, i, packet(1, 0));
  EXPECT_EQ(by_count.packets(), RetransmissionHistory::kMaxPackets);
}

}  // namespace
}  // namespace tessera::transport
