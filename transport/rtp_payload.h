// What a coded frame is cut into for RTP.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace tessera::transport {

// One payload: `prefix` and then `body`, which lies inside the coded frame (nothing is copied).
struct RtpPayload {
  uint8_t prefix[2] = {};
  uint8_t prefix_bytes = 0;
  std::span<const uint8_t> body;
  bool last = false;  // of its frame: the RTP marker bit

  size_t size() const { return prefix_bytes + body.size(); }
};

}  // namespace tessera::transport
