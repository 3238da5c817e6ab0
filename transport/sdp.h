// The description with which other players (ffmpeg, GStreamer) receive a session's video (RFC 4566, RFC 6184
// section 8.2).
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "base/status.h"
#include "transport/messages.h"
#include "transport/rtp_sender.h"

namespace tessera::transport {

struct SdpSettings {
  std::string address = "127.0.0.1";  // where the player receives; IPv4 or IPv6 in numbers
  uint16_t port = 0;                  // RTP and RTCP on one port (RFC 5761)
  StreamIds stream;
  std::string cname = "tessera";
  bool retransmission = true;  // offer NACK, PLI and RTX
  // Of what the server sends (RFC 4568): keep the text as secret as the key.
  std::optional<SrtpKey> srtp = std::nullopt;
};

// `parameter_sets`: an access unit (Annex B) with SPS and PPS, i.e. any key frame. InvalidArgument: it has
// none.
StatusOr<std::string> make_sdp(const SdpSettings& settings, std::span<const uint8_t> parameter_sets);

}  // namespace tessera::transport
