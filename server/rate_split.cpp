#include "server/rate_split.h"

#include <algorithm>

namespace tessera::server {

double RateSplit::atlas_bits(double meta_bits, bool key_frame) const {
  const double allowance = frame_bits() * (key_frame ? key_frame_budgets : 1.0);
  return std::max(allowance - meta_bits, atlas_floor * allowance);
}

RateSplit RateSplit::at_interval(DurationNs interval_ns) const {
  const double frames = std::clamp(0.5 * to_seconds(interval_ns) * frames_per_second, 1.0, key_frame_budgets);
  RateSplit slower = *this;
  slower.frames_per_second /= frames;
  slower.key_frame_budgets /= frames;
  return slower;
}

bool RateSplit::may_render(DurationNs backlog_ns) const {
  return to_seconds(backlog_ns) * frames_per_second <= 1.0;
}

}  // namespace tessera::server
