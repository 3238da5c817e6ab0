#include "transport/picture_payload.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "test_streams.h"

namespace tessera::transport {
namespace {

using test::Bytes;
using test::from_hex;

struct Packet {
  ExtendedSequence sequence;
  RtpHeader header;
  Bytes payload;
};

Bytes picture(size_t bytes, uint32_t seed) {
  std::mt19937 random(seed);
  Bytes out(bytes);
  for (uint8_t& byte : out) byte = static_cast<uint8_t>(random());
  return out;
}

// Numbers and times as a sender gives them.
class Stream {
 public:
  std::vector<Packet> packets(const Bytes& packet, size_t max_payload = 100) {
    std::vector<Packet> out;
    timestamp_ += 3000;
    for (const RtpPayload& p : packetize_picture(packet, max_payload)) {
      Bytes payload(p.prefix, p.prefix + p.prefix_bytes);
      payload.insert(payload.end(), p.body.begin(), p.body.end());
      EXPECT_LE(payload.size(), max_payload);
      out.push_back({next_, {p.last, 96, static_cast<uint16_t>(next_), timestamp_, 1}, payload});
      ++next_;
    }
    return out;
  }

 private:
  ExtendedSequence next_ = 7;
  uint32_t timestamp_ = 0;
};

std::vector<ReceivedFrame> feed(Depacketizer& depacketizer, const std::vector<Packet>& packets) {
  std::vector<ReceivedFrame> out;
  for (const Packet& p : packets) depacketizer.push(0, p.sequence, {p.header, p.payload}, out);
  return out;
}

TEST(PicturePayload, IsTheDocumentedOne) {
  const Bytes packet = from_hex("01 02 03 04 05");
  const std::vector<RtpPayload> payloads = packetize_picture(packet, 4);
  ASSERT_EQ(payloads.size(), 2u);
  EXPECT_EQ(payloads[0].prefix[0], 1);
  EXPECT_EQ(payloads[1].prefix[0], 0);
  EXPECT_EQ(payloads[0].size() + payloads[1].size(), 7u);
  EXPECT_FALSE(payloads[0].last);
  EXPECT_TRUE(payloads[1].last);
  EXPECT_TRUE(packetize_picture({}, 4).empty());
}

TEST(PicturePayload, PacketsOfAnySizeComeBack) {
  Stream stream;
  const auto depacketizer = Depacketizer::create(AtlasCodec::jpeg, 1 << 20);
  for (size_t bytes : {1u, 2u, 98u, 99u, 100u, 198u, 199u, 5000u}) {
    for (size_t max_payload : {2u, 3u, 100u, 1186u}) {
      const Bytes sent = picture(bytes, 1);
      const auto frames = feed(*depacketizer, stream.packets(sent, max_payload));
      ASSERT_EQ(frames.size(), 1u);
      EXPECT_TRUE(frames[0].complete);
      EXPECT_TRUE(frames[0].key_frame);
      EXPECT_FALSE(frames[0].follows_gap);
      EXPECT_EQ(frames[0].access_unit, sent);
    }
  }
  EXPECT_EQ(depacketizer->malformed(), 0u);
}

TEST(PicturePayload, AnyLossIsMarkedAndSpreadsNoFurther) {
  for (size_t lost = 0; lost < 12; ++lost) {
    Stream stream;
    const auto depacketizer = Depacketizer::create(AtlasCodec::jpeg, 1 << 20);
    std::vector<Packet> packets;
    for (uint32_t n = 0; n < 4; ++n)
      std::ranges::copy(stream.packets(picture(290, n)), std::back_inserter(packets));
    ASSERT_EQ(packets.size(), 12u);
    depacketizer->begin(packets.front().sequence);
    packets.erase(packets.begin() + static_cast<ptrdiff_t>(lost));
    uint32_t whole = 0;
    for (const ReceivedFrame& frame : feed(*depacketizer, packets)) {
      const bool sent = frame.access_unit == picture(290, frame.rtp_timestamp / 3000 - 1);
      EXPECT_EQ(frame.complete, sent) << "packet " << lost;
      whole += frame.complete ? 1 : 0;
    }
    EXPECT_EQ(whole, 3u) << "packet " << lost;
  }
}

TEST(PicturePayload, WhoJoinsMidwayWaitsForAPacketsBeginning) {
  Stream stream;
  const auto depacketizer = Depacketizer::create(AtlasCodec::jpeg, 1 << 20);
  std::vector<Packet> packets = stream.packets(picture(290, 1));
  packets.erase(packets.begin());
  std::ranges::copy(stream.packets(picture(290, 2)), std::back_inserter(packets));
  const auto frames = feed(*depacketizer, packets);
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_FALSE(frames[0].complete);
  EXPECT_TRUE(frames[1].complete);
}

TEST(PicturePayload, NonsenseAndExcessAreMarked) {
  const auto frame_with = [](size_t index, const Bytes& payload) {
    Stream stream;
    const auto depacketizer = Depacketizer::create(AtlasCodec::raw, 1000);
    std::vector<Packet> packets = stream.packets(picture(290, 1));
    depacketizer->begin(packets.front().sequence);
    packets[index].payload = payload;
    const auto frames = feed(*depacketizer, packets);
    EXPECT_EQ(frames.size(), 1u);
    return std::pair(frames[0].complete, depacketizer->malformed());
  };
  EXPECT_EQ(frame_with(1, {}), std::pair(false, uint64_t{1}));
  EXPECT_EQ(frame_with(1, {0}), std::pair(false, uint64_t{1})) << "a piece without bytes";
  EXPECT_EQ(frame_with(1, {2, 0}), std::pair(false, uint64_t{1})) << "unknown flags";
  EXPECT_EQ(frame_with(1, {1, 0}), std::pair(false, uint64_t{0})) << "a second beginning";
  EXPECT_EQ(frame_with(0, {0, 0}), std::pair(false, uint64_t{0})) << "no beginning";
  EXPECT_EQ(frame_with(1, Bytes(900, 0)), std::pair(false, uint64_t{0})) << "longer than the limit";
  EXPECT_EQ(frame_with(1, Bytes(50, 0)), std::pair(true, uint64_t{0}));
}

}  // namespace
}  // namespace tessera::transport
