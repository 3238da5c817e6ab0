// Between TimeNs and the time formats of RTP. NTP times here count from the clock's own start: RFC 3550
// section 4 lets a source without wall-clock time report elapsed time. Times before the start are not
// supported.
#pragma once

#include <cstdint>

#include "base/time.h"

namespace tessera::transport {

// 32.32 fixed-point seconds.
constexpr uint64_t ntp_from(TimeNs t) {
  const auto ns = static_cast<uint64_t>(t);
  return ns / kNsPerSecond << 32 | ((ns % kNsPerSecond) << 32) / kNsPerSecond;
}

constexpr uint32_t middle_32(uint64_t ntp) {
  return static_cast<uint32_t>(ntp >> 16);
}

// A duration in 1/65536 s, as in LSR and DLSR. It wraps after 18 hours.
constexpr uint32_t compact_ntp(DurationNs d) {
  return middle_32(ntp_from(d < 0 ? 0 : d));
}

constexpr DurationNs from_compact_ntp(uint32_t compact) {
  return static_cast<DurationNs>(uint64_t{compact} * kNsPerSecond >> 16);
}

// Ticks of an RTP clock, modulo 2^32.
constexpr uint32_t ticks_from(TimeNs t, uint32_t clock_hz) {
  const auto ns = static_cast<uint64_t>(t);
  return static_cast<uint32_t>(ns / kNsPerSecond * clock_hz + ns % kNsPerSecond * clock_hz / kNsPerSecond);
}

}  // namespace tessera::transport
