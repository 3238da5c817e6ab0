// When the next RTCP report is due: spread over 0.5..1.5 of the mean interval, so that ends do not fall into
// step (RFC 3550 6.3.1).
#pragma once

#include <random>

#include "base/time.h"

namespace tessera::transport {

class ReportTimer {
 public:
  ReportTimer(DurationNs mean_ns, uint64_t seed) : random_(seed), mean_ns_(mean_ns) {}

  // The first call starts the timer; true if a report is due, and then the next one is scheduled.
  bool due(TimeNs now) {
    if (!started_) {
      started_ = true;
      next_ns_ = now + spread() / 2;
      return false;
    }
    if (now < next_ns_) return false;
    next_ns_ = now + spread();
    return true;
  }
  TimeNs next_ns() const { return started_ ? next_ns_ : 0; }

 private:
  DurationNs spread() {
    const double share = 0.5 + static_cast<double>(random_() >> 11) * 0x1p-53;
    return static_cast<DurationNs>(share * static_cast<double>(mean_ns_));
  }
  std::mt19937_64 random_;
  DurationNs mean_ns_;
  TimeNs next_ns_ = 0;
  bool started_ = false;
};

}  // namespace tessera::transport
