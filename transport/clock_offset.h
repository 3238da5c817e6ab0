// The offset between two clocks, from pings (as NTP does, RFC 5905 section 8): of the recent exchanges, the
// one with the shortest round trip has the least queueing in it, so its offset is believed.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "base/time.h"
#include "transport/messages.h"

namespace tessera::transport {

class ClockOffset {
 public:
  static constexpr size_t kWindow = 32;                       // exchanges, and
  static constexpr DurationNs kMaxAgeNs = 30 * kNsPerSecond;  // age, after which drift outweighs queueing

  // `received_ns`: on the client's clock. False, and nothing changes, if the times contradict each other.
  bool on_pong(TimeNs received_ns, const ClockPong& pong);

  // Server clock minus client clock; empty before the first exchange. It is wrong by at most half of
  // round_trip_ns().
  std::optional<DurationNs> offset_ns() const;
  std::optional<DurationNs> round_trip_ns() const;  // the shortest of the window
  TimeNs to_server(TimeNs client_ns) const { return client_ns + offset_ns().value_or(0); }
  TimeNs to_client(TimeNs server_ns) const { return server_ns - offset_ns().value_or(0); }

 private:
  struct Sample {
    TimeNs at_ns;
    DurationNs offset_ns, round_trip_ns;
  };
  const Sample* best() const;
  std::deque<Sample> samples_;
};

}  // namespace tessera::transport
