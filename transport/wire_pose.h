// A pose on the wire: the same 61 or 73 bytes in a datagram and in a TCP frame (docs/protocol.md).
#pragma once

#include <cstdint>
#include <optional>

#include "base/view.h"
#include "transport/byte_io.h"

namespace tessera::transport {

struct SequencedPose {
  uint32_t sequence = 0;  // counts poses on both ways together; wraps around
  TimedPose timed;        // for when it is, on the client's clock; it may be a prediction
  TimeNs sent_ns = 0;     // when it was sent, on the same clock
  // Where the eyes look, in the head's axes, of unit length; none: nobody knows.
  std::optional<vec3> gaze;
};

constexpr double kMaxPositionM = 1e9;
// Of every time that comes from outside, of either sign: sums of a few never overflow.
constexpr TimeNs kMaxTimeNs = TimeNs{1} << 60;
constexpr bool is_sane(TimeNs t) {
  return t >= -kMaxTimeNs && t <= kMaxTimeNs;
}

void write_pose(const SequencedPose& pose, ByteWriter& out);
// Latches the reader's error for a time beyond kMaxTimeNs, a value that is not finite, a position beyond
// ±kMaxPositionM, or a quaternion or gaze whose length is not within 0.5..2. Both come out with unit length.
SequencedPose read_pose(ByteReader& in);

// Four f32: x, y, z, w. Latches the error for a length that is not within 0.5..2; the result has unit length.
void write_orientation(const dquat& orientation, ByteWriter& out);
dquat read_orientation(ByteReader& in);

// Newest wins: whether a pose is newer than all before it (serial numbers, RFC 1982).
class NewestPose {
 public:
  bool accept(uint32_t sequence) {
    if (newest_ && static_cast<int32_t>(sequence - *newest_) <= 0) return false;
    newest_ = sequence;
    return true;
  }

 private:
  std::optional<uint32_t> newest_;
};

}  // namespace tessera::transport
