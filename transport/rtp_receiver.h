// The receiving end of one video stream: datagrams in, access units and feedback out. Sans-IO: the caller
// carries datagrams and time. Safe for untrusted input; memory is bounded by the settings.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/atlas_codec.h"
#include "base/status.h"
#include "base/time.h"
#include "transport/depacketizer.h"
#include "transport/nack_generator.h"
#include "transport/rtp_packet.h"

namespace tessera::transport {

struct RtpReceiverSettings {
  uint64_t seed = 0;                    // of its own SSRC and report times
  AtlasCodec codec = AtlasCodec::h264;  // decides the payload format
  uint8_t payload_type = 96, rtx_payload_type = 97;
  // What the sender said in its welcome. Empty: the first packet of each payload type decides.
  std::optional<uint32_t> ssrc, rtx_ssrc;
  // Likewise; then losses at the very start are recovered too. Not for a receiver that joins a running
  // stream.
  std::optional<uint16_t> first_sequence;
  std::string cname = "tessera";
  NackSettings nack;
  DurationNs report_interval_ns = kNsPerSecond;    // mean, see RtpSenderSettings
  DurationNs key_frame_retry_ns = 200 * kNsPerMs;  // between requests; or two round trips, if that is longer
  size_t max_buffered_packets = 8192;  // that wait for a missing one; then the oldest gap is given up
  size_t max_buffered_bytes = 8u << 20;
  size_t max_frame_bytes = Depacketizer::kDefaultMaxFrameBytes;
  // That wait for take_frame(); then the oldest are dropped. A gap of give_up_ns releases as many at once.
  size_t max_frames = 256, max_queued_frame_bytes = 32u << 20;
};

struct RtpReceiverStats {
  uint64_t packets = 0, bytes = 0;  // accepted datagrams of media and retransmissions
  uint64_t recovered = 0;           // by retransmission
  uint64_t duplicates = 0;          // or too late
  uint64_t rejected = 0;            // malformed, or not of this stream
  uint64_t nacks = 0;               // sequence numbers asked for, repetitions included
  uint64_t given_up = 0;            // packets lost for good
  uint64_t frames = 0, incomplete_frames = 0, dropped_frames = 0;
  uint64_t key_frame_requests = 0;  // PLI messages
};

// Not thread-safe. Times passed in never decrease.
class RtpReceiver {
 public:
  explicit RtpReceiver(const RtpReceiverSettings& settings);
  ~RtpReceiver();

  // A datagram of the stream. InvalidArgument (counted): malformed, or another stream's.
  Status on_rtp(TimeNs now, std::span<const uint8_t> datagram);
  Status on_rtcp(TimeNs now, std::span<const uint8_t> datagram);
  // Feedback to send now.
  std::vector<Datagram> poll(TimeNs now);
  // When to call poll() next.
  TimeNs next_event_ns() const;
  // The last datagram (RTCP BYE).
  Datagram make_bye(TimeNs now, std::string reason) const;

  // Frames in decoding order; check `complete`.
  std::optional<ReceivedFrame> take_frame();
  // Asks for a key frame until a complete one has come (PLI). Losses that were given up do this by
  // themselves.
  void request_key_frame();
  bool wants_key_frame() const;
  bool sender_left() const;  // it said BYE

  // A round trip measured elsewhere (the hello exchange, clock pings).
  void set_rtt(DurationNs rtt_ns);
  DurationNs rtt_ns() const;
  uint32_t jitter() const;  // RFC 3550, 90 kHz ticks
  RtpReceiverStats stats() const;
  size_t memory_bytes() const;  // of packets and frames that wait

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::transport
