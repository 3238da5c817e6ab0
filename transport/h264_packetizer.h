// An H.264 access unit as RTP payloads (RFC 6184, packetization-mode 1).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace tessera::transport {

// One payload: `prefix` and then `body`, which lies inside the access unit (nothing is copied).
struct H264Payload {
  uint8_t prefix[2] = {};
  uint8_t prefix_bytes = 0;  // 0: a single NAL unit; 2: an FU-A fragment
  std::span<const uint8_t> body;
  bool last = false;  // of its access unit: the RTP marker bit (RFC 6184 5.1)

  size_t size() const { return prefix_bytes + body.size(); }
};

constexpr size_t kMinH264PayloadBytes = 3;  // an FU-A fragment of one byte

// `access_unit` is in Annex B form. A NAL unit of up to `max_payload_bytes` (>= kMinH264PayloadBytes) travels
// whole, a larger one in FU-A fragments of almost equal size. Empty if there is no NAL unit.
std::vector<H264Payload> packetize_h264(std::span<const uint8_t> access_unit, size_t max_payload_bytes);

}  // namespace tessera::transport
