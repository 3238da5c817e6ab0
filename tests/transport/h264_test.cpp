// Packetizer and depacketizer are inverse to each other, and the depacketizer bears loss and nonsense.
#include <gtest/gtest.h>

#include <random>

#include "test_streams.h"
#include "transport/h264_depacketizer.h"
#include "transport/h264_packetizer.h"
#include "transport/nal.h"

namespace tessera::transport {
namespace {

using test::Bytes;
using test::from_hex;
using test::join;
using test::make_nal;

struct Packet {
  ExtendedSequence sequence;
  RtpHeader header;
  Bytes payload;
};

class Stream {
 public:
  explicit Stream(ExtendedSequence first = 100) : next_(first) {}
  std::vector<Packet> packets(const Bytes& access_unit, size_t max_payload) {
    std::vector<Packet> out;
    timestamp_ += 3000;
    for (const RtpPayload& p : packetize_h264(access_unit, max_payload)) {
      Bytes payload(p.prefix, p.prefix + p.prefix_bytes);
      payload.insert(payload.end(), p.body.begin(), p.body.end());
      EXPECT_LE(payload.size(), max_payload);
      out.push_back({next_++, {p.last, 96, static_cast<uint16_t>(next_), timestamp_, 1}, payload});
    }
    return out;
  }

 private:
  ExtendedSequence next_;
  uint32_t timestamp_ = 0;
};

std::vector<ReceivedFrame> feed(H264Depacketizer& depacketizer, const std::vector<Packet>& packets) {
  std::vector<ReceivedFrame> out;
  for (const Packet& p : packets) depacketizer.push(0, p.sequence, {p.header, p.payload}, out);
  return out;
}

// The head of a stream: a small key frame, so that what follows is not "joined midway".
void begin(H264Depacketizer& depacketizer, Stream& stream) {
  std::mt19937_64 random(1);
  ASSERT_EQ(feed(depacketizer, stream.packets(test::make_access_unit(true, 20, random), 1000)).size(), 1u);
}

TEST(Nal, SplitsAnyMixOfStartCodes) {
  const Bytes stream =
      from_hex("00 00 00 00 01 67 aa 00 00 01 68 00 bb 00 00 00 01 00 00 01 65 00 00 03 01 00");
  const std::vector<Nal> nals = split_annex_b(stream);
  ASSERT_EQ(nals.size(), 3u);
  EXPECT_EQ(Bytes(nals[0].begin(), nals[0].end()), from_hex("67 aa"));
  EXPECT_EQ(Bytes(nals[1].begin(), nals[1].end()), from_hex("68 00 bb"));
  EXPECT_EQ(Bytes(nals[2].begin(), nals[2].end()), from_hex("65 00 00 03 01"));
  for (const char* none : {"", "00", "00 00 01", "00 00 00 01 00 00", "11 22 33"})
    EXPECT_TRUE(split_annex_b(from_hex(none)).empty());
}

// Every size of unit around the fragmentation borders, for small and usual payload limits.
TEST(H264, DepacketizeIsInverseToPacketize) {
  std::mt19937_64 random(2);
  for (size_t max_payload : {3u, 4u, 5u, 7u, 16u, 100u, 1186u}) {
    H264Depacketizer depacketizer;
    Stream stream;
    begin(depacketizer, stream);
    for (size_t bytes = 2; bytes < 4 * max_payload + 10; bytes += 1 + max_payload / 60) {
      const Bytes unit = join({make_nal(6, 2 + bytes % 5, random), make_nal(1, bytes, random)});
      const auto frames = feed(depacketizer, stream.packets(unit, max_payload));
      ASSERT_EQ(frames.size(), 1u);
      ASSERT_TRUE(frames[0].complete && !frames[0].key_frame && !frames[0].follows_gap);
      ASSERT_EQ(frames[0].access_unit, unit) << max_payload << " " << bytes;
    }
  }
}

TEST(H264, FragmentsAreOfAlmostEqualSizeAndWellFormed) {
  std::mt19937_64 random(3);
  const Bytes nal = make_nal(5, 5000, random);
  const Bytes unit = join({nal});
  const auto payloads = packetize_h264(unit, 1186);
  ASSERT_EQ(payloads.size(), 5u);
  for (size_t i = 0; i < payloads.size(); ++i) {
    EXPECT_EQ(payloads[i].prefix[0], 0x60 | 28);
    EXPECT_EQ(payloads[i].prefix[1], (i == 0 ? 0x80 : 0) | (i == 4 ? 0x40 : 0) | 5);
    EXPECT_NEAR(static_cast<double>(payloads[i].body.size()), 4999 / 5.0, 1);
    EXPECT_EQ(payloads[i].last, i == 4);
  }
}

TEST(H264, ReadsAggregates) {
  H264Depacketizer depacketizer;
  std::vector<ReceivedFrame> out;
  const Bytes payload = from_hex("78 0003 67 01 02 0002 68 03 0004 65 88 84 21");
  depacketizer.push(5, 9, {{true, 96, 9, 1000, 1}, payload}, out);
  ASSERT_EQ(out.size(), 1u);
  EXPECT_EQ(out[0].access_unit, from_hex("00000001 670102 00000001 6803 00000001 65888421"));
  EXPECT_TRUE(out[0].complete && out[0].key_frame);  // starts with an SPS: nothing can have come before
}

TEST(H264, EveryTruncationOfAnAggregateIsMarked) {
  const Bytes payload = from_hex("78 0003 67 01 02 0002 68 03 0004 65 88 84 21");
  for (size_t n = 1; n < payload.size(); ++n) {
    H264Depacketizer depacketizer;
    std::vector<ReceivedFrame> out;
    const Bytes cut(payload.begin(), payload.begin() + static_cast<ptrdiff_t>(n));
    depacketizer.push(0, 9, {{true, 96, 9, 1000, 1}, cut}, out);
    ASSERT_EQ(out.size(), 1u);
    const bool whole_units = n == 6 || n == 10;
    EXPECT_EQ(out[0].complete, whole_units) << n;
    EXPECT_EQ(depacketizer.malformed(), whole_units ? 0u : 1u);
  }
}

TEST(H264, ReservedTypesAndBrokenFragmentsAreMarked) {
  for (const char* bad :
       {"", "00 11", "79 00 00 01 67", "7a 11", "7b 11", "7d 80 11", "7e 11", "7f 11", "7c", "7c 85",
        "7c c5 11", "7c 80 11", "7c 9c 11", "78", "78 0000", "78 0001 78", "78 0001 7c"}) {
    H264Depacketizer depacketizer;
    Stream stream;
    begin(depacketizer, stream);
    std::vector<ReceivedFrame> out;
    depacketizer.push(0, 200, {{true, 96, 9, 1000, 1}, from_hex(bad)}, out);
    ASSERT_EQ(out.size(), 1u) << bad;
    EXPECT_FALSE(out[0].complete) << bad;
    EXPECT_EQ(depacketizer.malformed(), 1u) << bad;
  }
}

// Whichever packets are lost, every frame that kept all of its own packets and the ones around its borders is
// whole and right, and no frame is called complete that is not.
TEST(H264, AnyLossIsMarkedAndSpreadsNoFurther) {
  std::mt19937_64 random(4);
  for (int round = 0; round < 300; ++round) {
    Stream stream;
    std::vector<Bytes> units;
    std::vector<Packet> kept;
    std::vector<bool> intact;
    for (int f = 0; f < 8; ++f) {
      units.push_back(test::make_access_unit(f % 4 == 0, 2 + random() % 400, random));
      intact.push_back(true);
      for (Packet& p : stream.packets(units.back(), 60)) {
        if (random() % 20 == 0 && f > 0) {
          intact.back() = false;
        } else {
          kept.push_back(std::move(p));
        }
      }
    }
    H264Depacketizer depacketizer;
    const auto frames = feed(depacketizer, kept);
    size_t complete = 0;
    for (const ReceivedFrame& frame : frames) {
      const size_t index = frame.rtp_timestamp / 3000 - 1;
      if (frame.complete) {
        EXPECT_TRUE(intact[index]);
        EXPECT_EQ(frame.access_unit, units[index]);
        ++complete;
      }
      // What is left consists of whole units of the original.
      for (Nal nal : split_annex_b(frame.access_unit)) {
        EXPECT_NE(std::search(units[index].begin(), units[index].end(), nal.begin(), nal.end()),
                  units[index].end());
      }
    }
    size_t surely = 0;
    for (size_t f = 0; f < intact.size(); ++f) surely += intact[f] && (f == 0 || intact[f - 1] || f % 4 == 0);
    EXPECT_GE(complete, surely);
  }
}

TEST(H264, AFrameLargerThanTheLimitIsCutAndMarked) {
  std::mt19937_64 random(5);
  H264Depacketizer depacketizer(1000);
  Stream stream;
  begin(depacketizer, stream);
  auto frames =
      feed(depacketizer, stream.packets(join({make_nal(1, 100, random), make_nal(1, 2000, random)}), 200));
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_FALSE(frames[0].complete);
  EXPECT_LE(frames[0].access_unit.size(), 1000u);
  EXPECT_EQ(frames[0].access_unit.size(), 104u);  // the unit that fitted
  const Bytes small = join({make_nal(1, 100, random)});
  frames = feed(depacketizer, stream.packets(small, 200));
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_TRUE(frames[0].complete);
  EXPECT_EQ(frames[0].access_unit, small);
}

TEST(H264, ATimestampChangeEndsAFrameWithoutMarker) {
  H264Depacketizer depacketizer;
  std::vector<ReceivedFrame> out;
  depacketizer.push(0, 1, {{false, 96, 1, 1000, 1}, from_hex("67 01 02")}, out);
  depacketizer.push(0, 2, {{true, 96, 2, 2000, 1}, from_hex("41 01 02")}, out);
  ASSERT_EQ(out.size(), 2u);
  EXPECT_TRUE(out[0].complete && out[1].complete);
}

}  // namespace
}  // namespace tessera::transport
