// A picture packet (JPEG or raw atlas) as RTP payloads and back, by our own payload format (docs/protocol.md,
// "Video"): a byte of flags, then a piece of the packet. RFC 2435 is no choice: it knows neither pictures in
// tiles nor sides above 2040.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "transport/depacketizer.h"
#include "transport/rtp_payload.h"

namespace tessera::transport {

constexpr uint8_t kFirstPiece = 1;  // flag: a packet begins here; the other bits are 0
constexpr size_t kMinPicturePayloadBytes = 2;

// Pieces of almost equal size, each with its flags at most `max_payload_bytes` (>= kMinPicturePayloadBytes).
// Empty if the packet is.
std::vector<RtpPayload> packetize_picture(std::span<const uint8_t> packet, size_t max_payload_bytes);

// Every picture is a key frame. Safe for untrusted input.
class PictureDepacketizer final : public Depacketizer {
 public:
  using Depacketizer::Depacketizer;

 private:
  bool starts_frame(std::span<const uint8_t> payload) const override;
  void add_payload(std::span<const uint8_t> payload) override;
};

}  // namespace tessera::transport
