#include "transport/depacketizer.h"

#include <algorithm>
#include <utility>

#include "transport/h264_depacketizer.h"
#include "transport/picture_payload.h"

namespace tessera::transport {

std::unique_ptr<Depacketizer> Depacketizer::create(AtlasCodec codec, size_t max_frame_bytes) {
  if (codec == AtlasCodec::h264) return std::make_unique<H264Depacketizer>(max_frame_bytes);
  return std::make_unique<PictureDepacketizer>(max_frame_bytes);
}

void Depacketizer::push(TimeNs arrival_ns, ExtendedSequence sequence, const RtpPacket& packet,
                        std::vector<ReceivedFrame>& out) {
  const bool gap = last_ && sequence != *last_ + 1;
  const bool joined_midway = !last_;
  last_ = sequence;
  if (gap && open_) damaged();
  if (open_ && packet.header.timestamp != frame_.rtp_timestamp) end_frame(out);
  if (!open_) {
    begin_frame(arrival_ns, packet, gap);
    if ((gap || joined_midway) && !starts_frame(packet.payload)) frame_.complete = false;
  }
  frame_.last_packet_ns = std::max(frame_.last_packet_ns, arrival_ns);
  frame_.first_packet_ns = std::min(frame_.first_packet_ns, arrival_ns);
  add_payload(packet.payload);
  if (packet.header.marker) end_frame(out);
}

void Depacketizer::begin_frame(TimeNs arrival_ns, const RtpPacket& packet, bool after_gap) {
  frame_ = {};
  frame_.rtp_timestamp = packet.header.timestamp;
  frame_.complete = true;
  frame_.follows_gap = after_gap;
  frame_.first_packet_ns = frame_.last_packet_ns = arrival_ns;
  open_ = true;
}

void Depacketizer::end_frame(std::vector<ReceivedFrame>& out) {
  finish();
  open_ = false;
  // A frame of which nothing is left still tells that it was there.
  out.push_back(std::exchange(frame_, {}));
}

bool Depacketizer::fits(size_t bytes) {
  if (bytes <= max_frame_bytes_ - frame_.access_unit.size()) return true;
  damaged();
  return false;
}

void Depacketizer::malformed_payload() {
  ++malformed_;
  damaged();
}

}  // namespace tessera::transport
