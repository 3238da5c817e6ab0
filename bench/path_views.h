// The views that a session predicts on a recorded path.
#pragma once

#include <vector>

#include "base/camera_path.h"
#include "base/view.h"
#include "bench/settings.h"

namespace tessera::bench {

struct PathViews {
  TimedPose newest;         // that the server has
  std::vector<View> views;  // predicted from it and those before it, over a round trip and two server periods
};

// At `path_s` on the path, whose poses arrive at the client's frame rate. Of `settings` it uses client,
// server-fps, pvs and delay.
PathViews path_views(const LoopbackSettings& settings, const CameraPath& path, double path_s);

}  // namespace tessera::bench
