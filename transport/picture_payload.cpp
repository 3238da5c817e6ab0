#include "transport/picture_payload.h"

#include <cassert>

namespace tessera::transport {

std::vector<RtpPayload> packetize_picture(std::span<const uint8_t> packet, size_t max_payload_bytes) {
  assert(max_payload_bytes >= kMinPicturePayloadBytes);
  const size_t most = max_payload_bytes - 1;
  const size_t count = (packet.size() + most - 1) / most;
  std::vector<RtpPayload> out;
  for (size_t i = 0; i < count; ++i) {
    const size_t bytes = packet.size() / (count - i);
    RtpPayload& payload = out.emplace_back();
    payload.prefix[0] = i == 0 ? kFirstPiece : 0;
    payload.prefix_bytes = 1;
    payload.body = packet.first(bytes);
    payload.last = i + 1 == count;
    packet = packet.subspan(bytes);
  }
  return out;
}

bool PictureDepacketizer::starts_frame(std::span<const uint8_t> payload) const {
  return !payload.empty() && payload[0] == kFirstPiece;
}

void PictureDepacketizer::add_payload(std::span<const uint8_t> payload) {
  const bool first = frame().access_unit.empty();
  if (payload.size() < kMinPicturePayloadBytes || payload[0] > kFirstPiece) return malformed_payload();
  // Its beginning was lost, or another one's pieces have got in between.
  if (starts_frame(payload) != first) return damaged();
  const std::span<const uint8_t> piece = payload.subspan(1);
  if (!fits(piece.size())) return;
  frame().access_unit.insert(frame().access_unit.end(), piece.begin(), piece.end());
  frame().key_frame = true;
}

}  // namespace tessera::transport
