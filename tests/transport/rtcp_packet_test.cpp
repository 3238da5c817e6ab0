#include "transport/rtcp_packet.h"

#include <gtest/gtest.h>

#include <random>

#include "test_streams.h"

namespace tessera::transport {
namespace {

using test::Bytes;
using test::from_hex;

struct Known {
  const char* name;
  RtcpPacket packet;
  const char* hex;  // laid out by hand after RFC 3550 6.4-6.6, RFC 4585 6.2-6.3, RFC 5104 4.3.1
};

const ReportBlock kBlock{0x11223344, 64, -2, 0x0001ffff, 90, 0xaabbccdd, 65536};
constexpr const char* kBlockHex = "11223344 40fffffe 0001ffff 0000005a aabbccdd 00010000";

std::vector<Known> known() {
  static const std::string sr =
      std::string("81c8000c 00000001 83aa7e80 80000000 00015f90 00000064 00002710") + kBlockHex;
  static const std::string rr = std::string("81c90007 00000002") + kBlockHex;
  return {
      {"SR", SenderReport{1, 0x83aa7e8080000000, 90'000, 100, 10'000, {kBlock}}, sr.c_str()},
      {"RR", ReceiverReport{2, {kBlock}}, rr.c_str()},
      {"empty RR", ReceiverReport{2, {}}, "80c90001 00000002"},
      // Item end plus padding: 1, 2, 3 and 4 zeros.
      {"SDES", SourceDescription{{{3, "abcde"}}}, "81ca0003 00000003 01056162 63646500"},
      {"SDES of two", SourceDescription{{{3, "ab"}, {4, "abc"}}},
       "82ca0006 00000003 01026162 00000000 00000004 01036162 63000000"},
      {"BYE", Bye{{5, 6}, "end"}, "82cb0003 00000005 00000006 03656e64"},
      {"BYE without reason", Bye{{5}, ""}, "81cb0001 00000005"},
      {"NACK", Nack{7, 8, {0xfffe, 0xffff, 14, 15}}, "81cd0004 00000007 00000008 fffe8001 000f0000"},
      {"PLI", PictureLoss{9, 10}, "81ce0002 00000009 0000000a"},
      {"FIR", FullIntraRequest{11, {{12, 3}}}, "84ce0004 0000000b 00000000 0000000c 03000000"},
  };
}

TEST(Rtcp, KnownBytesBothWays) {
  for (const Known& k : known()) {
    EXPECT_EQ(build_rtcp({&k.packet, 1}), from_hex(k.hex)) << k.name;
    const auto parsed = parse_rtcp(from_hex(k.hex));
    ASSERT_TRUE(parsed.ok()) << k.name << ": " << parsed.status();
    ASSERT_EQ(parsed->size(), 1u);
    EXPECT_TRUE(parsed->front() == k.packet) << k.name;
  }
}

TEST(Rtcp, CompoundsKeepTheirOrder) {
  std::vector<RtcpPacket> all;
  for (const Known& k : known()) all.push_back(k.packet);
  const Datagram bytes = build_rtcp(all);
  const auto parsed = parse_rtcp(bytes);
  ASSERT_TRUE(parsed.ok()) << parsed.status();
  EXPECT_TRUE(*parsed == all);
}

// Whole packets are a valid, shorter compound; any other cut is an error.
TEST(Rtcp, EveryTruncationIsAnError) {
  std::vector<RtcpPacket> all;
  std::vector<size_t> ends;
  Datagram bytes;
  for (const Known& k : known()) {
    all.push_back(k.packet);
    bytes = build_rtcp(all);
    ends.push_back(bytes.size());
  }
  for (size_t n = 0; n <= bytes.size(); ++n) {
    const Bytes cut(bytes.begin(), bytes.begin() + static_cast<ptrdiff_t>(n));
    const bool whole = std::find(ends.begin(), ends.end(), n) != ends.end();
    EXPECT_EQ(parse_rtcp(cut).ok(), whole) << n;
  }
}

// The length field lies while the datagram is long enough: counts do not fit their packet.
TEST(Rtcp, CountsBeyondThePacketAreErrors) {
  for (const char* hex :
       {"82c90007 00000002 11223344 40fffffe 0001ffff 0000005a aabbccdd 00010000",  // 2 blocks, 1 there
        "81c80001 00000001",                                                        // SR without its body
        "82ca0003 00000003 01056162 63646500",                                      // 2 chunks
        "81ca0002 00000003 01ff6162",                                               // item too long
        "83cb0001 00000005",                                                        // 3 sources
        "81cb0002 00000005 09656e64",                                               // reason too long
        "81cd0001 00000007", "81ce0001 00000009"}) {
    EXPECT_EQ(parse_rtcp(from_hex(hex)).status().code(), absl::StatusCode::kInvalidArgument) << hex;
  }
}

TEST(Rtcp, PaddingOnlyInTheLastPacket) {
  EXPECT_TRUE(parse_rtcp(from_hex("80c90001 00000002 a1ce0003 00000009 0000000a 00000004")).ok());
  EXPECT_FALSE(parse_rtcp(from_hex("a1ce0003 00000009 0000000a 00000004 80c90001 00000002")).ok());
  EXPECT_FALSE(parse_rtcp(from_hex("a1ce0003 00000009 0000000a 00000003")).ok());
  EXPECT_FALSE(parse_rtcp(from_hex("a1ce0003 00000009 0000000a 00000010")).ok());
  EXPECT_FALSE(parse_rtcp(from_hex("41ce0002 00000009 0000000a")).ok());  // version 1
}

TEST(Rtcp, UnknownTypesArePassedOver) {
  const auto parsed =
      parse_rtcp(from_hex("81cf0001 00000002 8fcd0002 00000001 00000002 81ce0002 00000009 0000000a"));
  ASSERT_TRUE(parsed.ok());
  ASSERT_EQ(parsed->size(), 3u);
  EXPECT_TRUE((*parsed)[0] == RtcpPacket(UnknownRtcp{207, 1}));
  EXPECT_TRUE((*parsed)[1] == RtcpPacket(UnknownRtcp{205, 15}));  // transport-wide feedback
  EXPECT_TRUE((*parsed)[2] == RtcpPacket(PictureLoss{9, 10}));
}

TEST(Rtcp, ListsBeyondTheirMaximumAreCut) {
  const RtcpPacket report = ReceiverReport{1, std::vector<ReportBlock>(40)};
  const auto parsed = parse_rtcp(build_rtcp({&report, 1}));
  ASSERT_TRUE(parsed.ok());
  EXPECT_EQ(std::get<ReceiverReport>(parsed->front()).blocks.size(), 31u);
  const RtcpPacket bye = Bye{{1}, std::string(300, 'x')};
  const auto parsed_bye = parse_rtcp(build_rtcp({&bye, 1}));
  ASSERT_TRUE(parsed_bye.ok());
  EXPECT_EQ(std::get<Bye>(parsed_bye->front()).reason.size(), 255u);
}

TEST(Rtcp, NacksOfAnyLossPatternComeBack) {
  std::mt19937 random(3);
  for (int round = 0; round < 500; ++round) {
    Nack nack{1, 2, {}};
    uint16_t sequence = static_cast<uint16_t>(random());
    const auto count = random() % 100;
    for (unsigned i = 0; i < count; ++i) {
      nack.sequences.push_back(sequence);
      sequence = static_cast<uint16_t>(sequence + 1 + random() % (1u << random() % 8));
    }
    const RtcpPacket packet = nack;
    const auto parsed = parse_rtcp(build_rtcp({&packet, 1}));
    ASSERT_TRUE(parsed.ok());
    ASSERT_TRUE(parsed->front() == packet);
  }
}

TEST(Rtcp, DamagedBytesNeverBreakTheParser) {
  std::vector<RtcpPacket> all;
  for (const Known& k : known()) all.push_back(k.packet);
  const Datagram good = build_rtcp(all);
  std::mt19937 random(4);
  for (int round = 0; round < 20'000; ++round) {
    Bytes bytes = good;
    for (int i = 0; i < 3; ++i) bytes[random() % bytes.size()] = static_cast<uint8_t>(random());
    const auto parsed = parse_rtcp(bytes);
    if (!parsed.ok()) continue;
    EXPECT_LE(parsed->size(), bytes.size() / 4);
  }
}

}  // namespace
}  // namespace tessera::transport
