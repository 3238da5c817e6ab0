#include "server/rate_split.h"

#include <algorithm>

namespace tessera::server {
namespace {

constexpr double kMostBalance = 0.25;  // of a frame

}  // namespace

double RateSplit::allowance(bool key_frame) const {
  return frame_bits() * (key_frame ? key_frame_budgets : 1.0);
}

double RateSplit::atlas_bits(double meta_bits, bool key_frame) const {
  return std::max(allowance(key_frame) - meta_bits, atlas_floor * allowance(key_frame));
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

double BitBalance::atlas_bits(const RateSplit& rate, double meta_bits, bool key_frame) {
  const double allowance = rate.allowance(key_frame);
  // None takes more than a key frame; and the rate may have fallen.
  limit_ = std::min(kMostBalance * allowance, rate.allowance(true) - allowance);
  balance_ = std::clamp(balance_, -limit_, limit_);
  unspent_ = kMeanShare * allowance + balance_ - meta_bits;
  return rate.atlas_bits(meta_bits - balance_, key_frame);
}

void BitBalance::spend(double atlas_bits) {
  balance_ = std::clamp(unspent_ - atlas_bits, -limit_, limit_);
}

}  // namespace tessera::server
