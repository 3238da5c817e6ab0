// 16-bit sequence numbers that wrap around, and the 64-bit ones that do not.
#pragma once

#include <cstdint>
#include <optional>

namespace tessera::transport {

// A sequence number counted on through its wrap-arounds. The first one seen keeps its value in the low 16
// bits.
using ExtendedSequence = int64_t;

// Maps each number to the extended one that lies nearest to the highest so far: right while a packet is less
// than 2^15 away from it.
class SequenceUnwrapper {
 public:
  ExtendedSequence unwrap(uint16_t sequence) {
    const ExtendedSequence extended = peek(sequence);
    if (!highest_ || extended > *highest_) highest_ = extended;
    return extended;
  }
  // The same, without taking it as seen.
  ExtendedSequence peek(uint16_t sequence) const {
    if (!highest_) return sequence + kFirstCycle;
    const auto low = static_cast<uint16_t>(*highest_);
    return *highest_ + static_cast<int16_t>(static_cast<uint16_t>(sequence - low));
  }
  std::optional<ExtendedSequence> highest() const { return highest_; }

 private:
  // Packets from before the first one stay positive.
  static constexpr ExtendedSequence kFirstCycle = 1 << 16;
  std::optional<ExtendedSequence> highest_;
};

}  // namespace tessera::transport
