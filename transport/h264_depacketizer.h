// RTP payloads back to H.264 access units (RFC 6184: single NAL units, STAP-A, FU-A). Safe for untrusted
// input.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/time.h"
#include "transport/rtp_packet.h"
#include "transport/sequence.h"

namespace tessera::transport {

struct ReceivedFrame {
  std::vector<uint8_t> access_unit;  // Annex B, four-byte start codes
  uint32_t rtp_timestamp = 0;
  bool complete = false;     // every packet was there
  bool key_frame = false;    // has an IDR slice
  bool follows_gap = false;  // packets before it were lost for good; they may have been frames of their own
  TimeNs first_packet_ns = 0, last_packet_ns = 0;  // arrival
};

// Takes packets in the order of their sequence numbers (gaps are losses) and gives frames in that order. A
// frame ends with its marker, or where the next timestamp begins. Frames that lost packets come out as far as
// they are whole: a NAL unit with a hole is left out and the frame is not `complete`. Memory: one access unit
// of at most `max_frame_bytes`; what exceeds it is left out likewise.
class H264Depacketizer {
 public:
  static constexpr size_t kDefaultMaxFrameBytes = 8u << 20;
  explicit H264Depacketizer(size_t max_frame_bytes = kDefaultMaxFrameBytes)
      : max_frame_bytes_(max_frame_bytes) {}

  // The stream begins with this packet. Else the first frame is complete only if it starts with an SPS or a
  // delimiter.
  void begin(ExtendedSequence first) { last_ = first - 1; }
  // `sequence` is above all before it. Appends the frames that it completes (0 to 2) to `out`.
  void push(TimeNs arrival_ns, ExtendedSequence sequence, const RtpPacket& packet,
            std::vector<ReceivedFrame>& out);
  // Payloads that could not be read (reserved types, broken aggregates), since the start.
  uint64_t malformed() const { return malformed_; }

 private:
  void begin_frame(TimeNs arrival_ns, const RtpPacket& packet, bool after_gap);
  void end_frame(std::vector<ReceivedFrame>& out);
  void add_payload(std::span<const uint8_t> payload);
  void add_aggregate(std::span<const uint8_t> payload);
  void add_fragment(std::span<const uint8_t> payload);
  void add_nal(std::span<const uint8_t> nal);
  bool fits(size_t bytes);
  void drop_fragments();
  void damaged();

  size_t max_frame_bytes_;
  std::optional<ExtendedSequence> last_;
  ReceivedFrame frame_;
  bool open_ = false;                      // frame_ has begun
  std::optional<size_t> fragments_begin_;  // where the unfinished FU-A unit starts in the access unit
  uint64_t malformed_ = 0;
};

}  // namespace tessera::transport
