// RTP payloads back to coded frames: what is the same for every payload format. Safe for untrusted input.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/atlas_codec.h"
#include "base/time.h"
#include "transport/rtp_packet.h"
#include "transport/sequence.h"

namespace tessera::transport {

struct ReceivedFrame {
  std::vector<uint8_t> access_unit;  // H.264: Annex B, four-byte start codes; else a picture packet
  uint32_t rtp_timestamp = 0;
  bool complete = false;     // every packet was there
  bool key_frame = false;    // H.264: has an IDR slice
  bool follows_gap = false;  // packets before it were lost for good; they may have been frames of their own
  TimeNs first_packet_ns = 0, last_packet_ns = 0;  // arrival
};

// Takes packets in the order of their sequence numbers (gaps are losses) and gives frames in that order. A
// frame ends with its marker, or where the next timestamp begins. Frames that lost packets come out as far as
// they are whole, and are not `complete`. Memory: one frame of at most `max_frame_bytes`; what exceeds it is
// left out likewise.
class Depacketizer {
 public:
  static constexpr size_t kDefaultMaxFrameBytes = 8u << 20;
  static std::unique_ptr<Depacketizer> create(AtlasCodec codec, size_t max_frame_bytes);

  explicit Depacketizer(size_t max_frame_bytes = kDefaultMaxFrameBytes) : max_frame_bytes_(max_frame_bytes) {}
  virtual ~Depacketizer() = default;

  // The stream begins with this packet. Else the first frame is complete only if it surely starts where it
  // seems to.
  void begin(ExtendedSequence first) { last_ = first - 1; }
  // `sequence` is above all before it. Appends the frames that it completes (0 to 2) to `out`.
  void push(TimeNs arrival_ns, ExtendedSequence sequence, const RtpPacket& packet,
            std::vector<ReceivedFrame>& out);
  // Payloads that could not be read, since the start.
  uint64_t malformed() const { return malformed_; }

 protected:
  // Whether a frame surely begins with this payload.
  virtual bool starts_frame(std::span<const uint8_t> payload) const = 0;
  // Adds it to frame().
  virtual void add_payload(std::span<const uint8_t> payload) = 0;
  // Something of the frame is missing.
  virtual void damaged() { frame_.complete = false; }
  // No more of it will come.
  virtual void finish() {}

  ReceivedFrame& frame() { return frame_; }
  // Else the frame is damaged.
  bool fits(size_t bytes);
  void malformed_payload();

 private:
  void begin_frame(TimeNs arrival_ns, const RtpPacket& packet, bool after_gap);
  void end_frame(std::vector<ReceivedFrame>& out);

  size_t max_frame_bytes_;
  std::optional<ExtendedSequence> last_;
  ReceivedFrame frame_;
  bool open_ = false;  // frame_ has begun
  uint64_t malformed_ = 0;
};

}  // namespace tessera::transport
