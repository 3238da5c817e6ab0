// RTP packets (RFC 3550 section 5.1) and their retransmission (RFC 4588 section 4). Parsers are safe for
// untrusted input and copy nothing.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/status.h"

namespace tessera::transport {

using Datagram = std::vector<uint8_t>;

constexpr size_t kRtpHeaderBytes = 12;
constexpr size_t kRtxHeaderBytes = 2;  // the original sequence number

struct RtpHeader {
  bool marker = false;
  uint8_t payload_type = 0;  // 0..127
  uint16_t sequence = 0;
  uint32_t timestamp = 0;
  uint32_t ssrc = 0;
  bool operator==(const RtpHeader&) const = default;
};

struct RtpPacket {
  RtpHeader header;
  std::span<const uint8_t> payload;  // inside the datagram; without contributing sources, extension, padding
};

// InvalidArgument: not version 2, or shorter than its header, extension or padding says.
StatusOr<RtpPacket> parse_rtp(std::span<const uint8_t> datagram);

// Appends the header; the payload follows it. No contributing sources, no extension, no padding.
void write_rtp_header(const RtpHeader& header, Datagram& out);

// The packet that carries `original` again in the retransmission stream: its own SSRC, payload type and
// sequence, the original's timestamp and marker. `original` must be a datagram of write_rtp_header.
Datagram make_rtx(std::span<const uint8_t> original, uint8_t payload_type, uint16_t sequence, uint32_t ssrc);

// The original packet inside a retransmission; `payload_type` and `ssrc` are those of the media stream.
// InvalidArgument: no room for the original sequence number.
StatusOr<RtpPacket> unwrap_rtx(const RtpPacket& rtx, uint8_t payload_type, uint32_t ssrc);

}  // namespace tessera::transport
