#include "transport/clock_offset.h"

#include <algorithm>

namespace tessera::transport {
namespace {

// Far beyond any real clock, and small enough that sums of two do not overflow.
bool plausible(TimeNs t) {
  return t > INT64_MIN / 4 && t < INT64_MAX / 4;
}

}  // namespace

bool ClockOffset::on_pong(TimeNs received_ns, const ClockPong& pong) {
  const TimeNs times[] = {received_ns, pong.client_sent, pong.server_received, pong.server_sent};
  if (!std::ranges::all_of(times, plausible)) return false;
  const DurationNs there = pong.server_received - pong.client_sent, back = pong.server_sent - received_ns;
  const DurationNs round_trip = (received_ns - pong.client_sent) - (pong.server_sent - pong.server_received);
  if (round_trip < 0 || pong.server_sent < pong.server_received) return false;
  samples_.push_back({received_ns, there / 2 + back / 2 + (there % 2 + back % 2) / 2, round_trip});
  while (samples_.size() > kWindow || received_ns - samples_.front().at_ns > kMaxAgeNs) samples_.pop_front();
  return true;
}

// The newest of equals.
const ClockOffset::Sample* ClockOffset::best() const {
  const Sample* best = nullptr;
  for (const Sample& s : samples_) {
    if (!best || s.round_trip_ns <= best->round_trip_ns) best = &s;
  }
  return best;
}

std::optional<DurationNs> ClockOffset::offset_ns() const {
  const Sample* sample = best();
  return sample ? std::optional(sample->offset_ns) : std::nullopt;
}

std::optional<DurationNs> ClockOffset::round_trip_ns() const {
  const Sample* sample = best();
  return sample ? std::optional(sample->round_trip_ns) : std::nullopt;
}

}  // namespace tessera::transport
