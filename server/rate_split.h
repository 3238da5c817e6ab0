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
  // Of a frame, both streams together.
  double allowance(bool key_frame) const;
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

// What frames take less or more than their bits, for those after them: encoders stay below what they may
// take, and geometry beside an atlas at its floor takes more. A quarter of a frame either way at most, so
// that no frame takes much longer on its way. Within these bounds the frames' mean is kept a little below the
// rate: packets have headers, and what has queued up (a key frame, a resent packet) must drain.
class BitBalance {
 public:
  static constexpr double kMeanShare = 0.92;  // of the rate; headers are 4 %

  // RateSplit::atlas_bits() with what was left so far. To be followed by spend().
  double atlas_bits(const RateSplit& rate, double meta_bits, bool key_frame);
  void spend(double atlas_bits);

 private:
  double balance_ = 0;
  double limit_ = 0;    // of the balance, either way
  double unspent_ = 0;  // the balance if the atlas took nothing
};

}  // namespace tessera::server
