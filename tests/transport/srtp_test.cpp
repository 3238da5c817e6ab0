#include "transport/srtp.h"

#include <gtest/gtest.h>

#include <random>

#include "test_streams.h"
#include "transport/rtcp_packet.h"

namespace tessera::transport {
namespace {

using test::Bytes;

SrtpKey key(uint8_t v) {
  SrtpKey k;
  k.fill(v);
  return k;
}

Datagram packet(uint16_t sequence, size_t bytes) {
  Datagram d;
  write_rtp_header({true, 96, sequence, 1000, 7}, d);
  d.resize(kRtpHeaderBytes + bytes, 0x42);
  return d;
}

class SrtpPair : public ::testing::Test {
 protected:
  std::unique_ptr<Srtp> server = *Srtp::create(key(1), key(2)), client = *Srtp::create(key(2), key(1));
};

TEST_F(SrtpPair, BothKindsComeBackThroughTheWrap) {
  for (int i = 0; i < 70'000; ++i) {
    const Datagram clear = packet(static_cast<uint16_t>(65'000 + i), static_cast<size_t>(i % 50));
    Datagram datagram = clear;
    ASSERT_TRUE(server->protect(datagram).ok());
    ASSERT_EQ(datagram.size(), clear.size() + 10);
    ASSERT_EQ(*client->unprotect(datagram), clear);
  }
  const RtcpPacket pli = PictureLoss{1, 2};
  const Datagram clear = build_rtcp({&pli, 1});
  Datagram datagram = clear;
  ASSERT_TRUE(client->protect(datagram).ok());
  EXPECT_LE(datagram.size(), clear.size() + kSrtpOverheadBytes);
  EXPECT_NE(Bytes(datagram.begin() + 8, datagram.begin() + 12), Bytes(clear.begin() + 8, clear.end()));
  EXPECT_EQ(*server->unprotect(datagram), clear);
}

TEST_F(SrtpPair, EveryChangedBitAndEveryTruncationIsRefused) {
  Datagram datagram = packet(1, 20);
  ASSERT_TRUE(server->protect(datagram).ok());
  for (size_t bit = 0; bit < 8 * datagram.size(); ++bit) {
    Datagram changed = datagram;
    changed[bit / 8] ^= static_cast<uint8_t>(1 << bit % 8);
    EXPECT_FALSE(client->unprotect(changed).ok()) << bit;
  }
  for (size_t n = 0; n < datagram.size(); ++n)
    EXPECT_FALSE(client->unprotect(std::span(datagram).first(n)).ok()) << n;
  EXPECT_TRUE(client->unprotect(datagram).ok());
  EXPECT_EQ(client->unprotect(datagram).status().code(), absl::StatusCode::kAlreadyExists);  // repeated
  EXPECT_EQ((*Srtp::create(key(2), key(9)))->unprotect(datagram).status().code(),
            absl::StatusCode::kUnauthenticated);
}

TEST_F(SrtpPair, ReorderingIsNoReplay) {
  std::vector<Datagram> datagrams;
  for (uint16_t i = 0; i < 500; ++i) {
    datagrams.push_back(packet(i, 10));
    ASSERT_TRUE(server->protect(datagrams.back()).ok());
  }
  ASSERT_TRUE(client->unprotect(datagrams.front()).ok());
  for (size_t i = datagrams.size(); i-- > 1;) EXPECT_TRUE(client->unprotect(datagrams[i]).ok()) << i;
}

TEST_F(SrtpPair, NonsenseIsRefused) {
  std::mt19937 random(1);
  for (size_t bytes = 0; bytes < 100; ++bytes) {
    Bytes nonsense(bytes);
    for (uint8_t& b : nonsense) b = static_cast<uint8_t>(random());
    if (bytes > 0) nonsense[0] = static_cast<uint8_t>(0x80 | (nonsense[0] & 0x3f));
    EXPECT_FALSE(client->unprotect(nonsense).ok());
    if (bytes >= 8) continue;
    EXPECT_FALSE(client->protect(nonsense).ok());
  }
}

}  // namespace
}  // namespace tessera::transport
