#include "transport/sdp.h"

#include <gtest/gtest.h>

#include "test_streams.h"

namespace tessera::transport {
namespace {

using test::from_hex;

const auto kKeyFrame = from_hex("00000001 67 42c01e d9 00000001 68 cb83cb20 00000001 65 888421");

TEST(Sdp, SaysWhatAPlayerNeeds) {
  const auto sdp = make_sdp({.address = "127.0.0.1", .port = 5004, .stream = {1, 2, 96, 97}}, kKeyFrame);
  ASSERT_TRUE(sdp.ok()) << sdp.status();
  EXPECT_EQ(
      *sdp,
      "v=0\r\no=- 1 1 IN IP4 127.0.0.1\r\ns=Tessera atlas\r\nc=IN IP4 127.0.0.1\r\nt=0 0\r\n"
      "m=video 5004 RTP/AVPF 96 97\r\na=recvonly\r\na=rtcp-mux\r\na=rtpmap:96 H264/90000\r\n"
      "a=fmtp:96 packetization-mode=1;profile-level-id=42c01e;sprop-parameter-sets=Z0LAHtk=,aMuDyyA=\r\n"
      "a=rtcp-fb:96 nack\r\na=rtcp-fb:96 nack pli\r\na=rtpmap:97 rtx/90000\r\na=fmtp:97 apt=96\r\n"
      "a=ssrc-group:FID 1 2\r\na=ssrc:1 cname:tessera\r\n");
}

TEST(Sdp, PlainWithoutRetransmission) {
  const auto sdp = make_sdp({.address = "::1", .port = 5004, .retransmission = false}, kKeyFrame);
  ASSERT_TRUE(sdp.ok());
  EXPECT_NE(sdp->find("c=IN IP6 ::1\r\n"), std::string::npos);
  EXPECT_NE(sdp->find("m=video 5004 RTP/AVP 96\r\n"), std::string::npos);
  EXPECT_EQ(sdp->find("rtx"), std::string::npos);
}

TEST(Sdp, NeedsParameterSets) {
  EXPECT_EQ(make_sdp({}, from_hex("00000001 65 888421")).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_FALSE(make_sdp({}, {}).ok());
}

}  // namespace
}  // namespace tessera::transport
