#include "transport/h264_depacketizer.h"

#include "transport/byte_io.h"
#include "transport/nal.h"

namespace tessera::transport {
namespace {

constexpr size_t kStartCodeBytes = 4;

}  // namespace

// H.264 7.4.1.2.3: nothing of the same picture may come before these.
bool H264Depacketizer::starts_frame(std::span<const uint8_t> payload) const {
  if (payload.empty()) return false;
  uint8_t type = nal_type(payload);
  if (type == kNalStapA && payload.size() > 3) type = payload[3] & 0x1f;
  return type == kNalSps || type == kNalDelimiter;
}

void H264Depacketizer::finish() {
  if (fragments_begin_) damaged();
}

void H264Depacketizer::drop_fragments() {
  if (fragments_begin_) frame().access_unit.resize(*fragments_begin_);
  fragments_begin_.reset();
}

void H264Depacketizer::damaged() {
  drop_fragments();
  Depacketizer::damaged();
}

void H264Depacketizer::add_nal(std::span<const uint8_t> nal) {
  if (!fits(kStartCodeBytes + nal.size())) return;
  append_annex_b(frame().access_unit, nal);
  frame().key_frame = frame().key_frame || nal_type(nal) == kNalIdrSlice;
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
    malformed_payload();
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
  if (!good) malformed_payload();
}

void H264Depacketizer::add_fragment(std::span<const uint8_t> payload) {
  const bool start = payload.size() > 1 && payload[1] & 0x80, end = payload.size() > 1 && payload[1] & 0x40;
  const uint8_t type = payload.size() > 1 ? payload[1] & 0x1f : 0;
  if (payload.size() < 3 || (start && end) || type == 0 || type >= kNalStapA) return malformed_payload();
  if (start && fragments_begin_) damaged();
  if (!start && !fragments_begin_) return damaged();  // its beginning was lost
  if (!fits(kStartCodeBytes + payload.size())) return;
  if (start) {
    fragments_begin_ = frame().access_unit.size();
    const auto header = static_cast<uint8_t>((payload[0] & 0xe0) | type);
    append_annex_b(frame().access_unit, {&header, 1});
  }
  frame().access_unit.insert(frame().access_unit.end(), payload.begin() + 2, payload.end());
  if (!end) return;
  fragments_begin_.reset();
  frame().key_frame = frame().key_frame || type == kNalIdrSlice;
}

}  // namespace tessera::transport
