#include "transport/h264_packetizer.h"

#include <algorithm>
#include <cassert>

#include "transport/nal.h"

namespace tessera::transport {
namespace {

// RFC 6184 5.8: the NAL header becomes the FU indicator (its importance bits) and the FU header (its type),
// so the fragments carry what follows it.
void append_fragments(Nal nal, size_t max_payload_bytes, std::vector<RtpPayload>& out) {
  const std::span<const uint8_t> data = nal.subspan(1);
  const size_t most = max_payload_bytes - 2;
  const size_t count = (data.size() + most - 1) / most;
  assert(count >= 2);  // start and end may not fall into one fragment
  size_t at = 0;
  for (size_t i = 0; i < count; ++i) {
    const size_t bytes = (data.size() - at) / (count - i);
    const uint8_t start = i == 0 ? 0x80 : 0, end = i + 1 == count ? 0x40 : 0;
    RtpPayload payload;
    payload.prefix[0] = static_cast<uint8_t>((nal[0] & 0xe0) | kNalFuA);
    payload.prefix[1] = static_cast<uint8_t>(start | end | nal_type(nal));
    payload.prefix_bytes = 2;
    payload.body = data.subspan(at, bytes);
    out.push_back(payload);
    at += bytes;
  }
}

}  // namespace

std::vector<RtpPayload> packetize_h264(std::span<const uint8_t> access_unit, size_t max_payload_bytes) {
  assert(max_payload_bytes >= kMinH264PayloadBytes);
  std::vector<RtpPayload> out;
  for (Nal nal : split_annex_b(access_unit)) {
    if (nal.size() <= max_payload_bytes) {
      out.push_back({.body = nal});
    } else {
      append_fragments(nal, max_payload_bytes, out);
    }
  }
  if (!out.empty()) out.back().last = true;
  return out;
}

}  // namespace tessera::transport
