#include "transport/retransmission_history.h"

#include <algorithm>
#include <utility>

namespace tessera::transport {

void RetransmissionHistory::add(TimeNs now, ExtendedSequence sequence, Datagram packet) {
  bytes_ += packet.size();
  packets_.push_back({sequence, now, now, std::move(packet)});
  trim(now);
}

void RetransmissionHistory::trim(TimeNs now) {
  const auto too_much = [&] {
    return bytes_ > settings_.max_bytes || packets_.size() > kMaxPackets ||
           now - packets_.front().first_sent_ns > settings_.max_age_ns ||
           packets_.back().sequence - packets_.front().sequence >= static_cast<int64_t>(kMaxPackets);
  };
  while (!packets_.empty() && too_much()) {
    bytes_ -= packets_.front().packet.size();
    packets_.pop_front();
  }
}

std::optional<std::span<const uint8_t>> RetransmissionHistory::take(TimeNs now, uint16_t sequence,
                                                                    DurationNs min_interval_ns) {
  if (!packets_.empty()) trim(now);
  const auto same = [&](const Entry& e) { return static_cast<uint16_t>(e.sequence) == sequence; };
  if (packets_.empty()) return std::nullopt;
  // Sequence numbers have no holes in practice: look where it should be, and search only if it is not there.
  const auto offset = static_cast<uint16_t>(sequence - static_cast<uint16_t>(packets_.front().sequence));
  auto found = offset < packets_.size() ? packets_.begin() + offset : packets_.end();
  if (found != packets_.end() && !same(*found)) found = std::ranges::find_if(packets_, same);
  if (found == packets_.end() || now - found->last_sent_ns < min_interval_ns) return std::nullopt;
  found->last_sent_ns = now;
  return found->packet;
}

}  // namespace tessera::transport
