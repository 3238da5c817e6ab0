// Time is int64 nanoseconds since an arbitrary start, as in OpenXR. It comes from an injectable clock, so
// that the same code runs in real time and in virtual time.
#pragma once

#include <chrono>
#include <cstdint>

namespace tessera {

using TimeNs = int64_t;
using DurationNs = int64_t;

constexpr DurationNs kNsPerMs = 1'000'000;
constexpr DurationNs kNsPerSecond = 1'000'000'000;

constexpr double to_seconds(DurationNs ns) {
  return static_cast<double>(ns) * 1e-9;
}
constexpr double to_ms(DurationNs ns) {
  return static_cast<double>(ns) * 1e-6;
}
constexpr DurationNs from_seconds(double s) {
  return static_cast<DurationNs>(s * 1e9 + (s < 0 ? -0.5 : 0.5));
}
constexpr DurationNs from_ms(double ms) {
  return from_seconds(ms * 1e-3);
}

class Clock {
 public:
  virtual ~Clock() = default;
  virtual TimeNs now() const = 0;
};

// Monotonic wall time.
class SteadyClock final : public Clock {
 public:
  TimeNs now() const override {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(
               std::chrono::steady_clock::now().time_since_epoch())
        .count();
  }
};

// Time that moves only when its owner says so. Not thread-safe.
class VirtualClock final : public Clock {
 public:
  TimeNs now() const override { return now_; }
  // Time never runs backwards: an earlier `t` leaves the clock where it is.
  void advance_to(TimeNs t) { now_ = t > now_ ? t : now_; }

 private:
  TimeNs now_ = 0;
};

}  // namespace tessera
