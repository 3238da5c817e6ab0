// Future views from past poses (thesis 7.1.1): where the client may look from until the next frame replaces
// this one.
#pragma once

#include <span>
#include <vector>

#include "base/view.h"

namespace tessera::pvs {

enum class PredictionMode {
  none,    // the newest pose only, for its moment
  linear,  // linear extrapolation of the last poses' motion
};

struct PredictionSettings {
  PredictionMode mode = PredictionMode::linear;
  DurationNs horizon_ns = 0;        // one round trip + one server period: how long the result must last
  DurationNs step_ns = 33'333'333;  // time between predicted views; longer where max_views would be exceeded
  // More latency means views further apart, not more of them: else a slow server would make itself slower.
  uint32_t max_views = 8;
  float base_margin = 0.2f;     // field of view grows by this share at rest (thesis: 20 %)
  float max_margin_rad = 0.7f;  // per side
};

// Views for times from `now_ns` to `now_ns + horizon_ns`, first to last, the newest pose's own view first.
// `history` is ordered by time, newest last, at least one pose; positions extrapolate linearly, orientations
// by constant angular velocity. Each view's field of view grows (and its resolution with it, so that pixels
// keep their angle) by a margin from the base margin, the angular speed and the angular acceleration, larger
// further ahead: by whole pixels, and later views are shifted by parts of a pixel, so that together they find
// slivers that the client's multisampling finds. Repeated or backward timestamps and gaps longer than 0.5 s
// count as standing still.
std::vector<View> predict_views(std::span<const TimedPose> history, TimeNs now_ns, const View& client_view,
                                const PredictionSettings& settings);

// The same for the eyes of a head, whose poses `history` holds: all views of the first eye, then as many of
// the next, for the same times. Of `client_view` only the resolution counts, which is one eye's.
std::vector<View> predict_views(std::span<const TimedPose> history, TimeNs now_ns, const View& client_view,
                                std::span<const Eye> eyes, const PredictionSettings& settings);

// How far ahead of `now_ns` its views are, for a newest pose of that moment.
std::vector<DurationNs> prediction_times(const PredictionSettings& settings);

}  // namespace tessera::pvs
