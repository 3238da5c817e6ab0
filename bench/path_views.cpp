#include "bench/path_views.h"

#include <algorithm>

#include "bench/streamer.h"
#include "pvs/prediction.h"

namespace tessera::bench {
namespace {

constexpr DurationNs kHistoryNs = kNsPerSecond / 4;

// The poses that a server has at `now_s` on the path.
std::vector<TimedPose> history_at(const CameraPath& path, double now_s, double fps) {
  std::vector<TimedPose> poses;
  const TimeNs now = from_seconds(now_s);
  for (TimeNs t = std::max<TimeNs>(0, now - kHistoryNs); t < now; t += from_seconds(1 / fps))
    poses.push_back({t, path.at(t)});
  poses.push_back({now, path.at(now)});
  return poses;
}

}  // namespace

PathViews path_views(const LoopbackSettings& settings, const CameraPath& path, double path_s) {
  const std::vector<TimedPose> poses = history_at(path, path_s, settings.fps);
  pvs::PredictionSettings prediction;
  prediction.mode =
      settings.pvs == Prediction::none ? pvs::PredictionMode::none : pvs::PredictionMode::linear;
  prediction.horizon_ns = from_ms(2 * settings.delay_ms) + 2 * from_seconds(1 / settings.server_fps);
  return {poses.back(), pvs::predict_views(poses, poses.back().time_ns, client_view(settings), prediction)};
}

}  // namespace tessera::bench
