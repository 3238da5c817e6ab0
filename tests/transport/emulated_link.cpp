#include "emulated_link.h"

#include <algorithm>

namespace tessera::transport::test {

// Two states (Gilbert): the mean share of losses is `loss`, their mean length `burst`.
bool EmulatedLink::lose() {
  if (settings_.burst <= 1) return uniform() < settings_.loss;
  const double leave = 1 / settings_.burst;
  const double enter = settings_.loss * leave / (1 - settings_.loss);
  in_burst_ = uniform() < (in_burst_ ? 1 - leave : enter);
  return in_burst_;
}

void EmulatedLink::send(TimeNs now, std::vector<uint8_t> datagram) {
  ++sent_;
  TimeNs at = now;
  if (settings_.rate_bps > 0) {
    const double queued = to_seconds(std::max<DurationNs>(0, busy_until_ns_ - now)) * settings_.rate_bps / 8;
    if (queued + static_cast<double>(datagram.size()) > static_cast<double>(settings_.queue_bytes)) {
      ++overflowed_;
      return;
    }
    busy_until_ns_ = std::max(now, busy_until_ns_) +
                     from_seconds(8.0 * (static_cast<double>(datagram.size()) + 28) / settings_.rate_bps);
    at = busy_until_ns_;
  }
  if (settings_.loss > 0 && lose()) {
    ++lost_;
    return;
  }
  const int copies = settings_.duplication > 0 && uniform() < settings_.duplication ? 2 : 1;
  for (int i = 0; i < copies; ++i) {
    const auto jitter = static_cast<DurationNs>(uniform() * static_cast<double>(settings_.jitter_ns));
    under_way_.emplace(at + settings_.delay_ns + jitter, datagram);
  }
}

std::vector<std::vector<uint8_t>> EmulatedLink::poll(TimeNs now) {
  std::vector<std::vector<uint8_t>> out;
  while (!under_way_.empty() && under_way_.begin()->first <= now)
    out.push_back(std::move(under_way_.extract(under_way_.begin()).mapped()));
  return out;
}

std::optional<TimeNs> EmulatedLink::next_event_ns() const {
  if (under_way_.empty()) return std::nullopt;
  return under_way_.begin()->first;
}

}  // namespace tessera::transport::test
