#include <algorithm>
#include <string_view>

#include "transport/byte_io.h"
#include "transport/rtcp_packet.h"
#include "transport/rtcp_types.h"

namespace tessera::transport {
namespace {

constexpr size_t kMaxCount = 31, kMaxText = 255;

template <class T>
std::span<const T> cut(const std::vector<T>& list) {
  return std::span(list).first(std::min(list.size(), kMaxCount));
}

// Writes one packet's header at once and its length when the packet is complete.
class PacketWriter {
 public:
  PacketWriter(Datagram& out, uint8_t type, size_t count) : out_(out), w_(out), begin_(out.size()) {
    w_.u8(static_cast<uint8_t>(2 << 6 | count));
    w_.u8(type);
    w_.u16(0);
  }
  ~PacketWriter() {
    pad();
    w_.patch_u16(begin_ + 2, static_cast<uint16_t>((out_.size() - begin_) / 4 - 1));
  }
  void pad() { w_.zeros((4 - (out_.size() - begin_) % 4) % 4); }
  void text(std::string_view s) {
    s = s.substr(0, kMaxText);
    w_.u8(static_cast<uint8_t>(s.size()));
    w_.bytes({reinterpret_cast<const uint8_t*>(s.data()), s.size()});
  }
  ByteWriter& bytes() { return w_; }

 private:
  Datagram& out_;
  ByteWriter w_;
  size_t begin_;
};

void write_blocks(ByteWriter& w, std::span<const ReportBlock> blocks) {
  for (const ReportBlock& b : blocks) {
    w.u32(b.ssrc);
    w.u8(b.fraction_lost);
    w.u24(static_cast<uint32_t>(std::clamp(b.cumulative_lost, -0x800000, 0x7fffff)) & 0xffffff);
    w.u32(b.highest_sequence);
    w.u32(b.jitter);
    w.u32(b.last_sr);
    w.u32(b.delay_since_last_sr);
  }
}

struct Builder {
  Datagram& out;

  void operator()(const SenderReport& r) const {
    const auto blocks = cut(r.blocks);
    PacketWriter p(out, kTypeSenderReport, blocks.size());
    p.bytes().u32(r.ssrc);
    p.bytes().u64(r.ntp);
    p.bytes().u32(r.rtp_timestamp);
    p.bytes().u32(r.packets);
    p.bytes().u32(r.octets);
    write_blocks(p.bytes(), blocks);
  }
  void operator()(const ReceiverReport& r) const {
    const auto blocks = cut(r.blocks);
    PacketWriter p(out, kTypeReceiverReport, blocks.size());
    p.bytes().u32(r.ssrc);
    write_blocks(p.bytes(), blocks);
  }
  void operator()(const SourceDescription& d) const {
    const auto chunks = cut(d.chunks);
    PacketWriter p(out, kTypeDescription, chunks.size());
    for (const SourceDescription::Chunk& chunk : chunks) {
      p.bytes().u32(chunk.ssrc);
      p.bytes().u8(kSdesCname);
      p.text(chunk.cname);
      p.bytes().u8(0);
      p.pad();
    }
  }
  void operator()(const Bye& bye) const {
    const auto ssrcs = cut(bye.ssrcs);
    PacketWriter p(out, kTypeBye, ssrcs.size());
    for (uint32_t ssrc : ssrcs) p.bytes().u32(ssrc);
    if (!bye.reason.empty()) p.text(bye.reason);
  }
  void operator()(const Nack& nack) const;
  void operator()(const PictureLoss& pli) const {
    PacketWriter p(out, kTypePayloadFeedback, kFormatPli);
    p.bytes().u32(pli.sender_ssrc);
    p.bytes().u32(pli.media_ssrc);
  }
  void operator()(const FullIntraRequest& fir) const {
    PacketWriter p(out, kTypePayloadFeedback, kFormatFir);
    p.bytes().u32(fir.sender_ssrc);
    p.bytes().u32(0);  // unused, RFC 5104 4.3.1.2
    for (const FullIntraRequest::Entry& e : fir.entries) {
      p.bytes().u32(e.ssrc);
      p.bytes().u8(e.sequence);
      p.bytes().u24(0);
    }
  }
  void operator()(const UnknownRtcp&) const {}
};

// RFC 4585 6.2.1: a number and a mask of the 16 that follow it. Takes what fits from the front of
// `sequences`.
void Builder::operator()(const Nack& nack) const {
  PacketWriter p(out, kTypeTransportFeedback, kFormatNack);
  p.bytes().u32(nack.sender_ssrc);
  p.bytes().u32(nack.media_ssrc);
  for (size_t i = 0; i < nack.sequences.size();) {
    const uint16_t first = nack.sequences[i++];
    uint16_t mask = 0;
    for (; i < nack.sequences.size(); ++i) {
      const auto ahead = static_cast<uint16_t>(nack.sequences[i] - first);
      if (ahead == 0 || ahead > 16) break;
      mask |= static_cast<uint16_t>(1u << (ahead - 1));
    }
    p.bytes().u16(first);
    p.bytes().u16(mask);
  }
}

}  // namespace

Datagram build_rtcp(std::span<const RtcpPacket> packets) {
  Datagram out;
  for (const RtcpPacket& packet : packets) std::visit(Builder{out}, packet);
  return out;
}

}  // namespace tessera::transport
