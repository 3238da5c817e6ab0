#include "transport/h264_depacketizer.h"

#include <algorithm>
#include <utility>

#include "transport/byte_io.h"
#include "transport/nal.h"

namespace tessera::transport {
namespace {

constexpr size_t kStartCodeBytes = 4;

// Whether an access unit surely starts here (H.264 7.4.1.2.3: nothing of the same picture may come before
// these).
bool starts_access_unit(std::span<const uint8_t> payload) {
  if (payload.empty()) return false;
  uint8_t type = nal_type(payload);
  if (type == kNalStapA && payload.size() > 3) type = payload[3] & 0x1f;
  return type == kNalSps || type == kNalDelimiter;
}

}  // namespace

void H264Depacketizer::push(TimeNs arrival_ns, ExtendedSequence sequence, const RtpPacket& packet,
                            std::vector<ReceivedFrame>& out) {
  const bool gap = last_ && sequence != *last_ + 1;
  const bool joined_midway = !last_;
  last_ = sequence;
  if (gap && open_) damaged();
  if (open_ && packet.header.timestamp != frame_.rtp_timestamp) end_frame(out);
  if (!open_) {
    begin_frame(arrival_ns, packet, gap);
    if ((gap || joined_midway) && !starts_access_unit(packet.payload)) frame_.complete = false;
  }
  frame_.last_packet_ns = std::max(frame_.last_packet_ns, arrival_ns);
  frame_.first_packet_ns = std::min(frame_.first_packet_ns, arrival_ns);
  add_payload(packet.payload);
  if (packet.header.marker) end_frame(out);
}

void H264Depacketizer::begin_frame(TimeNs arrival_ns, const RtpPacket& packet, bool after_gap) {
  frame_ = {};
  frame_.rtp_timestamp = packet.header.timestamp;
  frame_.complete = true;
  frame_.follows_gap = after_gap;
  frame_.first_packet_ns = frame_.last_packet_ns = arrival_ns;
  open_ = true;
}

void H264Depacketizer::end_frame(std::vector<ReceivedFrame>& out) {
  if (fragments_begin_) damaged();
  open_ = false;
  // A frame of which nothing is left still tells that it was there.
  out.push_back(std::exchange(frame_, {}));
}

void H264Depacketizer::drop_fragments() {
  if (fragments_begin_) frame_.access_unit.resize(*fragments_begin_);
  fragments_begin_.reset();
}

void H264Depacketizer::damaged() {
  drop_fragments();
  frame_.complete = false;
}

bool H264Depacketizer::fits(size_t bytes) {
  if (bytes + kStartCodeBytes <= max_frame_bytes_ - frame_.access_unit.size()) return true;
  damaged();
  return false;
}

void H264Depacketizer::add_nal(std::span<const uint8_t> nal) {
  if (!fits(nal.size())) return;
  append_annex_b(frame_.access_unit, nal);
  frame_.key_frame = frame_.key_frame || nal_type(nal) == kNalIdrSlice;
}

void H264Depacketizer::add_payload(std::span<const uint8_t> payload) {
  const uint8_t type = payload.empty() ? 0 : nal_type(payload);
  if (type != kNalFuA && fragments_begin_) damaged();  // the rest of a fragmented unit never came
  if (type == kNalFuA) {
    add_fragment(payload);
  } else if (type == kNalStapA) {
    add_aggregate(payload.subspan(1));
  } else if (type >= 1 && type < kNalStapA) {
    add_nal(payload);
  } else {  // STAP-B, MTAP, FU-B do not exist in packetization-mode 1
    ++malformed_;
    damaged();
  }
}

// RFC 6184 5.7.1: 16-bit sizes before each unit.
void H264Depacketizer::add_aggregate(std::span<const uint8_t> units) {
  ByteReader in(units);
  bool good = !units.empty();
  while (good && in.remaining() > 0) {
    const Nal nal = in.bytes(in.u16());
    good = in.ok() && !nal.empty() && nal_type(nal) >= 1 && nal_type(nal) < kNalStapA;
    if (good) add_nal(nal);
  }
  if (good) return;
  ++malformed_;
  damaged();
}

void H264Depacketizer::add_fragment(std::span<const uint8_t> payload) {
  const bool start = payload.size() > 1 && payload[1] & 0x80, end = payload.size() > 1 && payload[1] & 0x40;
  const uint8_t type = payload.size() > 1 ? payload[1] & 0x1f : 0;
  if (payload.size() < 3 || (start && end) || type == 0 || type >= kNalStapA) {
    ++malformed_;
    return damaged();
  }
  if (start && fragments_begin_) damaged();
  if (!start && !fragments_begin_) return damaged();  // its beginning was lost
  if (!fits(payload.size())) return;
  if (start) {
    fragments_begin_ = frame_.access_unit.size();
    const auto header = static_cast<uint8_t>((payload[0] & 0xe0) | type);
    append_annex_b(frame_.access_unit, {&header, 1});
  }
  frame_.access_unit.insert(frame_.access_unit.end(), payload.begin() + 2, payload.end());
  if (!end) return;
  fragments_begin_.reset();
  frame_.key_frame = frame_.key_frame || type == kNalIdrSlice;
}

}  // namespace tessera::transport
