#include "transport/rtcp_packet.h"

#include <algorithm>
#include <string_view>

#include "transport/byte_io.h"
#include "transport/rtcp_types.h"

namespace tessera::transport {
namespace {

Status malformed(const char* what) {
  return absl::InvalidArgumentError(absl::StrCat("RTCP: ", what));
}

std::string text(std::span<const uint8_t> bytes) {
  return {bytes.begin(), bytes.end()};
}

ReportBlock read_block(ByteReader& in) {
  ReportBlock b;
  b.ssrc = in.u32();
  b.fraction_lost = in.u8();
  const uint32_t lost = in.u24();
  b.cumulative_lost = static_cast<int32_t>(lost << 8) >> 8;  // sign of 24 bits
  b.highest_sequence = in.u32();
  b.jitter = in.u32();
  b.last_sr = in.u32();
  b.delay_since_last_sr = in.u32();
  return b;
}

std::vector<ReportBlock> read_blocks(ByteReader& in, uint8_t count) {
  std::vector<ReportBlock> blocks(count);
  for (ReportBlock& b : blocks) b = read_block(in);
  return blocks;
}

RtcpPacket read_sender_report(ByteReader& in, uint8_t count) {
  SenderReport r;
  r.ssrc = in.u32();
  r.ntp = in.u64();
  r.rtp_timestamp = in.u32();
  r.packets = in.u32();
  r.octets = in.u32();
  r.blocks = read_blocks(in, count);
  return r;
}

RtcpPacket read_receiver_report(ByteReader& in, uint8_t count) {
  ReceiverReport r;
  r.ssrc = in.u32();
  r.blocks = read_blocks(in, count);
  return r;
}

// RFC 3550 6.5: items until a zero byte, then zeros up to the next multiple of four bytes.
SourceDescription::Chunk read_chunk(ByteReader& in) {
  SourceDescription::Chunk chunk;
  const size_t begin = in.remaining();
  chunk.ssrc = in.u32();
  for (uint8_t item = in.u8(); item != 0; item = in.u8()) {
    const std::span<const uint8_t> value = in.bytes(in.u8());
    if (item == kSdesCname) chunk.cname = text(value);
    if (!in.ok()) break;
  }
  in.skip((4 - (begin - in.remaining()) % 4) % 4);
  return chunk;
}

RtcpPacket read_description(ByteReader& in, uint8_t count) {
  SourceDescription d;
  for (uint8_t i = 0; i < count && in.ok(); ++i) d.chunks.push_back(read_chunk(in));
  return d;
}

RtcpPacket read_bye(ByteReader& in, uint8_t count) {
  Bye bye;
  for (uint8_t i = 0; i < count; ++i) bye.ssrcs.push_back(in.u32());
  if (in.remaining() > 0) bye.reason = text(in.bytes(in.u8()));
  return bye;
}

RtcpPacket read_nack(ByteReader& in) {
  Nack nack;
  nack.sender_ssrc = in.u32();
  nack.media_ssrc = in.u32();
  while (in.remaining() >= 4) {
    const uint16_t first = in.u16(), mask = in.u16();
    nack.sequences.push_back(first);
    for (int bit = 0; bit < 16; ++bit) {
      if (mask >> bit & 1) nack.sequences.push_back(static_cast<uint16_t>(first + bit + 1));
    }
  }
  return nack;
}

RtcpPacket read_payload_feedback(ByteReader& in, uint8_t format) {
  const uint32_t sender = in.u32(), media = in.u32();
  if (format == kFormatPli) return PictureLoss{sender, media};
  if (format != kFormatFir) return UnknownRtcp{kTypePayloadFeedback, format};
  FullIntraRequest fir{sender, {}};
  while (in.remaining() >= 8) {
    const uint32_t ssrc = in.u32();
    fir.entries.push_back({ssrc, in.u8()});
    in.skip(3);
  }
  return fir;
}

RtcpPacket read_body(uint8_t type, uint8_t count, ByteReader& in) {
  switch (type) {
    case kTypeSenderReport:
      return read_sender_report(in, count);
    case kTypeReceiverReport:
      return read_receiver_report(in, count);
    case kTypeDescription:
      return read_description(in, count);
    case kTypeBye:
      return read_bye(in, count);
    case kTypePayloadFeedback:
      return read_payload_feedback(in, count);
    case kTypeTransportFeedback:
      if (count == kFormatNack) return read_nack(in);
      break;
    default:
      break;
  }
  return UnknownRtcp{type, count};
}

}  // namespace

StatusOr<std::vector<RtcpPacket>> parse_rtcp(std::span<const uint8_t> datagram) {
  std::vector<RtcpPacket> packets;
  ByteReader in(datagram);
  do {
    const uint8_t first = in.u8(), type = in.u8();
    std::span<const uint8_t> body = in.bytes(size_t{4} * in.u16());
    if (!in.ok()) return malformed("the datagram ends inside a packet");
    if (first >> 6 != 2) return malformed("version is not 2");
    if (first & 0x20) {
      if (in.remaining() > 0) return malformed("padding before the last packet");
      if (body.empty() || body.back() == 0 || body.back() % 4 != 0 || body.back() > body.size())
        return malformed("length of the padding");
      body = body.first(body.size() - body.back());
    }
    ByteReader fields(body);
    packets.push_back(read_body(type, first & 0x1f, fields));
    if (!fields.ok()) return malformed("a packet is shorter than its count says");
  } while (in.remaining() > 0);
  return packets;
}

}  // namespace tessera::transport
