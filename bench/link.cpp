#include "bench/link.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

namespace tessera::bench {

Link::Link(const LinkSettings& settings) : settings_(settings), random_(settings.seed) {
  assert(settings.rate_bps > 0 && settings.loss >= 0 && settings.loss < 1);
}

double Link::uniform() {
  return static_cast<double>(random_() >> 11) * 0x1p-53;
}

uint64_t Link::send(TimeNs now, Channel channel, std::vector<uint8_t> payload) {
  run_until(now);
  const uint64_t id = next_id_++;
  const auto bytes = static_cast<uint64_t>(payload.size());
  const uint64_t datagrams = std::max<uint64_t>(1, (bytes + kDatagramBytes - 1) / kDatagramBytes);
  in_flight_[id] = {{id, channel, now, 0, std::move(payload)}, static_cast<uint32_t>(datagrams), now};
  if (channel == Channel::meta) meta_order_.push_back(id);
  ++stats_.messages;
  for (uint64_t i = 0; i < datagrams; ++i) {
    transmit(now, id, static_cast<uint32_t>(std::min<uint64_t>(kDatagramBytes, bytes - i * kDatagramBytes)));
  }
  return id;
}

// The queue is first in, first out, so a datagram's fate is known as soon as it joins.
void Link::transmit(TimeNs now, uint64_t message, uint32_t bytes) {
  const double seconds = 8.0 * bytes / settings_.rate_bps;
  busy_until_ns_ = std::max(now, busy_until_ns_) + from_seconds(seconds);
  ++stats_.datagrams;
  stats_.bytes_on_wire += bytes;

  if (settings_.loss > 0 && uniform() < settings_.loss) {
    ++stats_.datagrams_lost;
    retransmissions_.push({busy_until_ns_ + 2 * settings_.delay_ns, next_order_++, message, bytes});
    return;
  }
  DurationNs delay = settings_.delay_ns;
  if (settings_.jitter_ns > 0) {
    delay += std::llround((2 * uniform() - 1) * static_cast<double>(settings_.jitter_ns));
  }
  Message& m = in_flight_.at(message);
  m.complete_ns = std::max(m.complete_ns, busy_until_ns_ + std::max<DurationNs>(0, delay));
  if (--m.datagrams_missing > 0) return;
  if (m.delivery.channel == Channel::meta) {
    release_meta();
  } else {
    schedule_delivery(message, m.complete_ns);
  }
}

void Link::release_meta() {
  while (!meta_order_.empty() && in_flight_.at(meta_order_.front()).datagrams_missing == 0) {
    const uint64_t id = meta_order_.front();
    meta_order_.pop_front();
    last_meta_ns_ = std::max(last_meta_ns_, in_flight_.at(id).complete_ns);
    schedule_delivery(id, last_meta_ns_);
  }
}

void Link::schedule_delivery(uint64_t message, TimeNs at_ns) {
  auto node = in_flight_.extract(message);
  Delivery& delivery = node.mapped().delivery;
  delivery.delivered_ns = at_ns;
  deliveries_.emplace(at_ns, std::move(delivery));
}

void Link::run_until(TimeNs now) {
  while (!retransmissions_.empty() && retransmissions_.top().due_ns <= now) {
    const Datagram datagram = retransmissions_.top();
    retransmissions_.pop();
    transmit(datagram.due_ns, datagram.message, datagram.bytes);
  }
}

std::optional<TimeNs> Link::next_event_ns() const {
  std::optional<TimeNs> next;
  if (!deliveries_.empty()) next = deliveries_.begin()->first;
  if (!retransmissions_.empty()) next = std::min(next.value_or(INT64_MAX), retransmissions_.top().due_ns);
  return next;
}

std::vector<Delivery> Link::poll(TimeNs now) {
  run_until(now);
  std::vector<Delivery> result;
  const auto end = deliveries_.upper_bound(now);
  for (auto it = deliveries_.begin(); it != end; ++it) result.push_back(std::move(it->second));
  deliveries_.erase(deliveries_.begin(), end);
  return result;
}

DurationNs Link::queued_ns(TimeNs now) const {
  return std::max<DurationNs>(0, busy_until_ns_ - now);
}

uint64_t Link::queued_bytes(TimeNs now) const {
  if (std::isinf(settings_.rate_bps)) return 0;
  return static_cast<uint64_t>(to_seconds(queued_ns(now)) * settings_.rate_bps / 8);
}

}  // namespace tessera::bench
