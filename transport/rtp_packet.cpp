#include "transport/rtp_packet.h"

#include <cassert>

#include "transport/byte_io.h"

namespace tessera::transport {
namespace {

constexpr uint8_t kVersion = 2;

Status too_short(const char* what, size_t bytes) {
  return absl::InvalidArgumentError(absl::StrCat("RTP: ", bytes, " bytes end inside the ", what));
}

// RFC 3550 5.1: the last byte says how many bytes of padding there are, itself included.
StatusOr<std::span<const uint8_t>> without_padding(std::span<const uint8_t> payload) {
  if (payload.empty() || payload.back() == 0 || payload.back() > payload.size())
    return absl::InvalidArgumentError("RTP: padding longer than the payload, or of length 0");
  return payload.first(payload.size() - payload.back());
}

}  // namespace

StatusOr<RtpPacket> parse_rtp(std::span<const uint8_t> datagram) {
  ByteReader in(datagram);
  const uint8_t first = in.u8(), second = in.u8();
  RtpPacket packet;
  packet.header.marker = second >> 7;
  packet.header.payload_type = second & 0x7f;
  packet.header.sequence = in.u16();
  packet.header.timestamp = in.u32();
  packet.header.ssrc = in.u32();
  if (!in.ok()) return too_short("header", datagram.size());
  if (first >> 6 != kVersion)
    return absl::InvalidArgumentError(absl::StrCat("RTP: version ", first >> 6, ", not 2"));

  in.skip(size_t{4} * (first & 0x0f));  // contributing sources
  if (first & 0x10) {                   // header extension, 5.3.1
    in.skip(2);
    in.skip(size_t{4} * in.u16());
  }
  if (!in.ok()) return too_short("contributing sources or the extension", datagram.size());
  packet.payload = in.rest();
  if (first & 0x20) {
    TESSERA_ASSIGN_OR_RETURN(packet.payload, without_padding(packet.payload));
  }
  return packet;
}

void write_rtp_header(const RtpHeader& header, Datagram& out) {
  assert(header.payload_type < 128);
  ByteWriter w(out);
  w.u8(kVersion << 6);
  w.u8(static_cast<uint8_t>((header.marker ? 0x80 : 0) | header.payload_type));
  w.u16(header.sequence);
  w.u32(header.timestamp);
  w.u32(header.ssrc);
}

Datagram make_rtx(std::span<const uint8_t> original, uint8_t payload_type, uint16_t sequence, uint32_t ssrc) {
  const StatusOr<RtpPacket> packet = parse_rtp(original);
  assert(packet.ok());
  RtpHeader header = packet->header;
  header.payload_type = payload_type;
  header.sequence = sequence;
  header.ssrc = ssrc;
  Datagram out;
  out.reserve(original.size() + kRtxHeaderBytes);
  write_rtp_header(header, out);
  ByteWriter w(out);
  w.u16(packet->header.sequence);
  w.bytes(packet->payload);
  return out;
}

StatusOr<RtpPacket> unwrap_rtx(const RtpPacket& rtx, uint8_t payload_type, uint32_t ssrc) {
  ByteReader in(rtx.payload);
  RtpPacket original = rtx;
  original.header.sequence = in.u16();
  original.header.payload_type = payload_type;
  original.header.ssrc = ssrc;
  original.payload = in.rest();
  if (!in.ok()) return absl::InvalidArgumentError("RTX: no original sequence number (RFC 4588 section 4)");
  return original;
}

}  // namespace tessera::transport
