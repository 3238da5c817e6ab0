// The number that pairs a frame's atlas with its meta packet. It wraps around at 2^32.
#pragma once

#include <cstdint>

namespace tessera {

using FrameNumber = uint32_t;

// True if `a` comes after `b` in serial-number order (RFC 1982): correct across the wrap while the two are
// less than 2^31 frames apart.
constexpr bool is_newer(FrameNumber a, FrameNumber b) {
  return static_cast<int32_t>(a - b) > 0;
}

}  // namespace tessera
