#include "transport/pacer.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tessera::transport {
namespace {

size_t wire_bytes(const PacedPacket& packet) {
  return packet.bytes.size() + Pacer::kIpUdpBytes;
}

}  // namespace

DurationNs Pacer::cost_ns(size_t bytes) const {
  return static_cast<DurationNs>(std::ceil(8e9 * static_cast<double>(bytes) / settings_.rate_bps));
}

double Pacer::frame_budget_bits(DurationNs frame_interval_ns, bool key_frame) const {
  const int intervals = key_frame ? kKeyFrameBudgets : 1;
  const double bits = settings_.rate_bps * to_seconds(intervals * frame_interval_ns);
  return std::max(0.0, bits - 8.0 * static_cast<double>(queued_bytes()));
}

Status Pacer::enqueue_frame(std::vector<PacedPacket> packets) {
  size_t bytes = 0;
  for (const PacedPacket& p : packets) bytes += wire_bytes(p);
  if (bytes > settings_.max_queued_bytes - std::min(settings_.max_queued_bytes, frame_bytes_))
    return absl::ResourceExhaustedError(absl::StrCat("pacer: a frame of ", bytes, " bytes behind ",
                                                     frame_bytes_, " queued ones exceeds max_queued_bytes (",
                                                     settings_.max_queued_bytes, ")"));
  frame_bytes_ += bytes;
  std::ranges::move(packets, std::back_inserter(frames_));
  return absl::OkStatus();
}

bool Pacer::enqueue_retransmission(PacedPacket packet) {
  const size_t bytes = wire_bytes(packet);
  if (retransmission_bytes_ + bytes > settings_.max_retransmission_bytes) return false;
  retransmission_bytes_ += bytes;
  retransmissions_.push_back(std::move(packet));
  return true;
}

const PacedPacket* Pacer::front() const {
  if (!retransmissions_.empty()) return &retransmissions_.front();
  return frames_.empty() ? nullptr : &frames_.front();
}

PacedPacket Pacer::pop() {
  auto& queue = retransmissions_.empty() ? frames_ : retransmissions_;
  PacedPacket packet = std::move(queue.front());
  (retransmissions_.empty() ? frame_bytes_ : retransmission_bytes_) -= wire_bytes(packet);
  queue.pop_front();
  return packet;
}

// The bucket, refilled at the rate, must hold the packet. One larger than the bucket waits for a full one.
TimeNs Pacer::earliest_ns(const PacedPacket& next) const {
  // Rounded so that the sum of all roundings never lets more through.
  const auto burst_ns =
      static_cast<DurationNs>(8e9 * static_cast<double>(settings_.burst_bytes) / settings_.rate_bps);
  const DurationNs slack = burst_ns - cost_ns(wire_bytes(next));
  return free_at_ns_ - std::max<DurationNs>(0, slack);
}

std::vector<PacedPacket> Pacer::poll(TimeNs now) {
  std::vector<PacedPacket> out;
  for (const PacedPacket* next = front(); next && earliest_ns(*next) <= now; next = front()) {
    free_at_ns_ = std::max(now, free_at_ns_) + cost_ns(wire_bytes(*next));
    out.push_back(pop());
  }
  return out;
}

std::optional<TimeNs> Pacer::next_event_ns() const {
  const PacedPacket* next = front();
  if (!next) return std::nullopt;
  return earliest_ns(*next);
}

}  // namespace tessera::transport
