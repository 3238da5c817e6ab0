// One direction of a network in virtual time: single datagrams are lost, doubled and delayed, from a seed.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <random>
#include <vector>

#include "base/time.h"

namespace tessera::transport::test {

struct EmulatedLinkSettings {
  DurationNs delay_ns = 25 * kNsPerMs;
  DurationNs jitter_ns = 0;  // added: uniform in 0..jitter; more than the distance of datagrams reorders them
  double loss = 0, duplication = 0;
  double burst = 1;     // mean length of losses in a row
  double rate_bps = 0;  // of a bottleneck with a queue of `queue_bytes`; 0: none
  size_t queue_bytes = 64 << 10;
  uint64_t seed = 1;
};

class EmulatedLink {
 public:
  explicit EmulatedLink(const EmulatedLinkSettings& settings) : settings_(settings), random_(settings.seed) {}

  void send(TimeNs now, std::vector<uint8_t> datagram);
  // What arrives up to `now`, in order of arrival.
  std::vector<std::vector<uint8_t>> poll(TimeNs now);
  std::optional<TimeNs> next_event_ns() const;

  uint64_t sent() const { return sent_; }
  uint64_t lost() const { return lost_; }              // by chance
  uint64_t overflowed() const { return overflowed_; }  // by a full queue

 private:
  double uniform() { return static_cast<double>(random_() >> 11) * 0x1p-53; }
  bool lose();

  EmulatedLinkSettings settings_;
  std::mt19937_64 random_;
  std::multimap<TimeNs, std::vector<uint8_t>> under_way_;
  TimeNs busy_until_ns_ = 0;
  bool in_burst_ = false;
  uint64_t sent_ = 0, lost_ = 0, overflowed_ = 0;
};

}  // namespace tessera::transport::test
