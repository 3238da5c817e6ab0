#include "transport/sdp.h"

#include "absl/strings/escaping.h"
#include "transport/nal.h"

namespace tessera::transport {
namespace {

std::string base64(Nal nal) {
  return absl::Base64Escape({reinterpret_cast<const char*>(nal.data()), nal.size()});
}

struct ParameterSets {
  Nal sps, pps;
};

StatusOr<ParameterSets> find_parameter_sets(std::span<const uint8_t> access_unit) {
  ParameterSets sets;
  for (Nal nal : split_annex_b(access_unit)) {
    if (nal_type(nal) == kNalSps) sets.sps = nal;
    if (nal_type(nal) == kNalPps) sets.pps = nal;
  }
  if (sets.sps.size() < 4 || sets.pps.empty())
    return absl::InvalidArgumentError("SDP: the access unit has no SPS and PPS; give a key frame");
  return sets;
}

std::string retransmission_lines(const StreamIds& stream) {
  const unsigned media = stream.payload_type, rtx = stream.rtx_payload_type;
  return absl::StrCat("a=rtcp-fb:", media, " nack\r\n", "a=rtcp-fb:", media, " nack pli\r\n",  //
                      "a=rtpmap:", rtx, " rtx/90000\r\n", "a=fmtp:", rtx, " apt=", media, "\r\n",
                      "a=ssrc-group:FID ", stream.ssrc, " ", stream.rtx_ssrc, "\r\n");
}

}  // namespace

StatusOr<std::string> make_sdp(const SdpSettings& settings, std::span<const uint8_t> parameter_sets) {
  TESSERA_ASSIGN_OR_RETURN(const ParameterSets sets, find_parameter_sets(parameter_sets));
  const char* family = settings.address.find(':') == std::string::npos ? "IP4" : "IP6";
  const unsigned media = settings.stream.payload_type;
  std::string sdp =
      absl::StrCat("v=0\r\n", "o=- ", settings.stream.ssrc, " 1 IN ", family, " ", settings.address, "\r\n",
                   "s=Tessera atlas\r\n", "c=IN ", family, " ", settings.address, "\r\n", "t=0 0\r\n");
  absl::StrAppend(&sdp, "m=video ", settings.port, " RTP/", settings.srtp ? "S" : "",
                  settings.retransmission ? "AVPF " : "AVP ", media);
  if (settings.retransmission) absl::StrAppend(&sdp, " ", unsigned{settings.stream.rtx_payload_type});
  absl::StrAppend(&sdp, "\r\na=recvonly\r\na=rtcp-mux\r\na=rtpmap:", media, " H264/90000\r\n");
  absl::StrAppend(&sdp, "a=fmtp:", media, " packetization-mode=1;profile-level-id=",
                  absl::BytesToHexString({reinterpret_cast<const char*>(sets.sps.data()) + 1, 3}),
                  ";sprop-parameter-sets=", base64(sets.sps), ",", base64(sets.pps), "\r\n");
  if (settings.srtp)
    absl::StrAppend(&sdp, "a=crypto:1 AES_CM_128_HMAC_SHA1_80 inline:", base64(*settings.srtp), "\r\n");
  if (settings.retransmission) absl::StrAppend(&sdp, retransmission_lines(settings.stream));
  absl::StrAppend(&sdp, "a=ssrc:", settings.stream.ssrc, " cname:", settings.cname, "\r\n");
  return sdp;
}

}  // namespace tessera::transport
