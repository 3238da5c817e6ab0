// An H.264 access unit as RTP payloads (RFC 6184, packetization-mode 1).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "transport/rtp_payload.h"

namespace tessera::transport {

constexpr size_t kMinH264PayloadBytes = 3;  // an FU-A fragment of one byte

// `access_unit` is in Annex B form. A NAL unit of up to `max_payload_bytes` (>= kMinH264PayloadBytes) travels
// whole, a larger one in FU-A fragments (a prefix of two bytes) of almost equal size. Empty if there is no
// NAL unit.
std::vector<RtpPayload> packetize_h264(std::span<const uint8_t> access_unit, size_t max_payload_bytes);

}  // namespace tessera::transport
