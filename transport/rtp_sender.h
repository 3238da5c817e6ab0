// The sending end of one video stream: access units in, paced datagrams out, retransmissions on request.
// Sans-IO: the caller carries datagrams and time. One of the two public faces of the core; the other is
// RtpReceiver.
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
#include "transport/pacer.h"
#include "transport/retransmission_history.h"
#include "transport/rtcp_packet.h"

namespace tessera::transport {

// How a stream is named on the wire; both ends must agree (the welcome message and the SDP carry it).
struct StreamIds {
  uint32_t ssrc = 0, rtx_ssrc = 0;
  uint8_t payload_type = 96, rtx_payload_type = 97;
  uint16_t first_sequence = 0;  // of the media stream
  bool operator==(const StreamIds&) const = default;
};

struct RtpSenderSettings {
  uint64_t seed =
      0;  // of SSRCs, first sequence numbers and the timestamp offset; give every session another one
  AtlasCodec codec = AtlasCodec::h264;  // decides the payload format
  uint8_t payload_type = 96, rtx_payload_type = 97;
  size_t max_datagram_bytes = 1200;  // of UDP payload, retransmissions included; 64..65507
  std::string cname = "tessera";     // up to 255 bytes
  PacerSettings pacer;
  HistorySettings history;
  DurationNs report_interval_ns = kNsPerSecond;  // mean; each is spread over 0.5..1.5 of it (RFC 3550 6.3.1)
  // A request within this time after a key frame was sent, or one round trip if that is longer, is answered
  // by that key frame.
  DurationNs min_key_frame_interval_ns = 250 * kNsPerMs;
};

struct RtpSenderStats {
  uint64_t frames = 0, packets = 0, bytes = 0;  // sent first; bytes of datagrams
  uint64_t retransmitted = 0, retransmitted_bytes = 0;
  uint64_t nacked = 0;             // sequence numbers that the peer asked for
  uint64_t not_retransmitted = 0;  // of those: too old, on their way already, or no room
  uint64_t key_frame_requests = 0;
  uint64_t malformed_rtcp = 0;

  RtpSenderStats& operator+=(const RtpSenderStats& other);
};

// What the peer last reported.
struct PeerReport {
  TimeNs received_ns = 0;
  double loss = 0;  // share of packets since its report before, 0..1
  int32_t cumulative_lost = 0;
  DurationNs jitter_ns = 0;
  std::optional<DurationNs> rtt_ns;  // empty before it has seen a sender report
};

// Not thread-safe. Times passed in never decrease. Memory is bounded by the settings.
class RtpSender {
 public:
  // InvalidArgument: settings outside their range.
  static StatusOr<std::unique_ptr<RtpSender>> create(const RtpSenderSettings& settings);
  ~RtpSender();

  const StreamIds& ids() const;
  AtlasCodec codec() const;

  // See Pacer::frame_budget_bits: ask before encoding, and drop the frame there if the budget is too small.
  double frame_budget_bits(DurationNs frame_interval_ns, bool key_frame) const;
  // Queues a whole access unit (H.264: Annex B; else a picture packet); `capture_ns` becomes its RTP
  // timestamp, which is returned. ResourceExhausted: the pacer's queue is full; nothing of it is sent and the
  // stream needs a key frame. InvalidArgument: no NAL unit, or an empty packet.
  StatusOr<uint32_t> send_frame(TimeNs now, TimeNs capture_ns, std::span<const uint8_t> access_unit,
                                bool key_frame);
  void set_rate(double rate_bps);

  // A datagram of the peer. InvalidArgument (counted) if it is malformed.
  Status on_rtcp(TimeNs now, std::span<const uint8_t> datagram);
  // Datagrams to send now, media and reports.
  std::vector<Datagram> poll(TimeNs now);
  // When to call poll() next.
  TimeNs next_event_ns() const;
  // The last datagram of the stream (RTCP BYE).
  Datagram make_bye(TimeNs now, std::string reason) const;

  // True once for each request, throttled.
  bool take_key_frame_request();
  bool peer_left() const;  // it said BYE
  const std::optional<PeerReport>& peer_report() const;
  const RtpSenderStats& stats() const;
  size_t queued_bytes() const;
  size_t memory_bytes() const;  // of packets in the queue and the history

 private:
  struct Impl;
  explicit RtpSender(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::transport
