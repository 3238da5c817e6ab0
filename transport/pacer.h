// Sends at an even rate, so that a frame never overflows a switch or a queue on its way (RELIABILITY: whole
// frames are dropped, never tails).
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "base/status.h"
#include "base/time.h"
#include "transport/rtp_packet.h"
#include "transport/sequence.h"

namespace tessera::transport {

struct PacerSettings {
  double rate_bps = 20e6;              // > 0; IP and UDP headers are counted
  size_t burst_bytes = 3000;           // what may leave at once; at least one datagram with its headers
  size_t max_queued_bytes = 4u << 20;  // of frames
  size_t max_retransmission_bytes = 256u << 10;  // of retransmissions
};

struct PacedPacket {
  Datagram bytes;
  ExtendedSequence sequence = 0;  // of the original
  bool retransmission = false;
};

// A token bucket in its virtual-scheduling form: in any time w at most burst_bytes + rate * w leave.
// Retransmissions go first. Both queues are bounded.
class Pacer {
 public:
  static constexpr size_t kIpUdpBytes = 28;  // IPv4; 48 with IPv6
  static constexpr int kKeyFrameBudgets = 4;

  explicit Pacer(const PacerSettings& settings) : settings_(settings) {}

  // The bits that a frame encoded now may have so that it is out within one frame interval (a key frame:
  // four). 0 when frames before it still fill that time: then drop the new frame before it is encoded.
  double frame_budget_bits(DurationNs frame_interval_ns, bool key_frame) const;
  // A frame with all its packets or, if the queue cannot hold them, nothing of it (ResourceExhausted).
  Status enqueue_frame(std::vector<PacedPacket> packets);
  // False if there is no room; the peer will ask again.
  bool enqueue_retransmission(PacedPacket packet);
  void set_rate(double rate_bps) { settings_.rate_bps = rate_bps; }

  // What may leave now, in order.
  std::vector<PacedPacket> poll(TimeNs now);
  // When poll() has something next. Empty when nothing waits.
  std::optional<TimeNs> next_event_ns() const;

  size_t queued_bytes() const { return frame_bytes_ + retransmission_bytes_; }  // with headers
  DurationNs queued_ns() const { return cost_ns(queued_bytes()); }              // time to drain it

 private:
  DurationNs cost_ns(size_t bytes) const;
  TimeNs earliest_ns(const PacedPacket& next) const;
  const PacedPacket* front() const;
  PacedPacket pop();

  PacerSettings settings_;
  std::deque<PacedPacket> frames_, retransmissions_;
  size_t frame_bytes_ = 0, retransmission_bytes_ = 0;
  TimeNs free_at_ns_ = INT64_MIN / 2;  // when the bucket is full again ("theoretical arrival time")
};

}  // namespace tessera::transport
