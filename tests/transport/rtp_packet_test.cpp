#include "transport/rtp_packet.h"

#include <gtest/gtest.h>

#include "test_streams.h"

namespace tessera::transport {
namespace {

using test::Bytes;
using test::from_hex;

// Laid out by hand after RFC 3550 5.1.
constexpr const char* kPlain = "80 e0 12 34  00 01 5f 90  ca fe ba be  65 01 02";
// Two contributing sources, an extension of one word, three bytes of padding.
constexpr const char* kFull =
    "b2 60 ff ff  ff ff ff ff  00 00 00 01  11 11 11 11 22 22 22 22  be de 00 01 10 aa 00 00  41 42 00 00 03";

TEST(RtpPacket, WritesTheHeaderOfTheRfc) {
  Datagram out;
  write_rtp_header({true, 96, 0x1234, 90'000, 0xcafebabe}, out);
  out.insert(out.end(), {0x65, 1, 2});
  EXPECT_EQ(out, from_hex(kPlain));
}

TEST(RtpPacket, ReadsPlainAndFullHeaders) {
  const Bytes plain = from_hex(kPlain);
  auto packet = parse_rtp(plain);
  ASSERT_TRUE(packet.ok()) << packet.status();
  EXPECT_EQ(packet->header, (RtpHeader{true, 96, 0x1234, 90'000, 0xcafebabe}));
  EXPECT_EQ(Bytes(packet->payload.begin(), packet->payload.end()), from_hex("65 01 02"));

  const Bytes full = from_hex(kFull);
  packet = parse_rtp(full);
  ASSERT_TRUE(packet.ok()) << packet.status();
  EXPECT_EQ(packet->header, (RtpHeader{false, 96, 0xffff, 0xffffffff, 1}));
  EXPECT_EQ(Bytes(packet->payload.begin(), packet->payload.end()), from_hex("41 42"));
}

TEST(RtpPacket, EveryTruncationIsAnErrorOrAShorterPayload) {
  const Bytes full = from_hex(kFull);
  for (size_t n = 0; n < full.size(); ++n) {
    const Bytes cut(full.begin(), full.begin() + static_cast<ptrdiff_t>(n));
    const auto packet = parse_rtp(cut);
    // Cut after "41": the padding length would be 0x41. Every other cut leaves a bad padding too.
    EXPECT_FALSE(packet.ok()) << n;
  }
  const Bytes plain = from_hex(kPlain);
  for (size_t n = 0; n < plain.size(); ++n) {
    const Bytes cut(plain.begin(), plain.begin() + static_cast<ptrdiff_t>(n));
    EXPECT_EQ(parse_rtp(cut).ok(), n >= kRtpHeaderBytes) << n;
  }
}

TEST(RtpPacket, RefusesOtherVersionsAndBadPadding) {
  for (int version : {0, 1, 3}) {
    Bytes bytes = from_hex(kPlain);
    bytes[0] = static_cast<uint8_t>(version << 6);
    EXPECT_EQ(parse_rtp(bytes).status().code(), absl::StatusCode::kInvalidArgument);
  }
  for (uint8_t padding : {0, 4, 255}) {
    Bytes bytes = from_hex(kPlain);
    bytes[0] |= 0x20;
    bytes.back() = padding;
    EXPECT_FALSE(parse_rtp(bytes).ok()) << int{padding};
  }
}

TEST(Rtx, CarriesTheOriginalSequenceNumber) {
  const Bytes original = from_hex(kPlain);
  const Datagram rtx = make_rtx(original, 97, 7, 0xaabbccdd);
  EXPECT_EQ(rtx, from_hex("80 e1 00 07  00 01 5f 90  aa bb cc dd  12 34  65 01 02"));
  const auto again = unwrap_rtx(*parse_rtp(rtx), 96, 0xcafebabe);
  ASSERT_TRUE(again.ok());
  EXPECT_EQ(again->header, parse_rtp(original)->header);
  EXPECT_EQ(Bytes(again->payload.begin(), again->payload.end()), from_hex("65 01 02"));
}

TEST(Rtx, NeedsRoomForIt) {
  const Bytes bytes = from_hex("80 61 00 07  00 01 5f 90  aa bb cc dd  12");
  EXPECT_FALSE(unwrap_rtx(*parse_rtp(bytes), 96, 1).ok());
}

}  // namespace
}  // namespace tessera::transport
