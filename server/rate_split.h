// How a frame's bits are split between geometry (which must arrive) and the atlas (which can be coarser).
#pragma once

#include "base/time.h"

namespace tessera::server {

struct RateSplit {
  double bitrate_bps = 20e6;  // both streams together
  double frames_per_second = 30;
  double atlas_floor = 0.25;  // the atlas gets at least this share of its frame, however large the geometry
  double key_frame_budgets = 4;  // a key frame may take this many frames' bits

  double frame_bits() const { return bitrate_bps / frames_per_second; }
  // For frames that come further apart than planned: a frame may then take half of its time, as long as a key
  // frame may take at most. Key frames stay as they are.
  RateSplit at_interval(DurationNs interval_ns) const;
  // Bits for the atlas beside `meta_bits` of geometry.
  double atlas_bits(double meta_bits, bool key_frame) const;
  // False while the network still holds more than one frame's worth of bytes: then the frame is skipped
  // before it is rendered, so that latency does not build up. `backlog_ns` = time until the sender's queue
  // has drained.
  bool may_render(DurationNs backlog_ns) const;
};

}  // namespace tessera::server
