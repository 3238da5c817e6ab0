// The secret that makes a peer a session's client: random, given out by the control service.
#pragma once

#include <array>
#include <cstdint>

namespace tessera::transport {

using SessionToken = std::array<uint8_t, 16>;

// Takes the same time wherever the two differ.
inline bool equal_in_constant_time(const SessionToken& a, const SessionToken& b) {
  volatile uint8_t difference = 0;
  for (size_t i = 0; i < a.size(); ++i) difference = static_cast<uint8_t>(difference | (a[i] ^ b[i]));
  return difference == 0;
}

}  // namespace tessera::transport
