// The passes of a session's frame, each with the reason why it is in or out. What a scene or a session does
// not need is left out: it allocates nothing and costs nothing.
#pragma once

#include <string>
#include <vector>

#include "atlas/density.h"
#include "scene/scene.h"

namespace tessera::server {

struct PlannedPass {
  std::string name;
  bool included = false;
  std::string reason;
};

struct FramePlan {
  std::vector<PlannedPass> passes;  // in the order in which a frame runs them

  bool includes(const std::string& name) const;
  std::string to_string() const;  // one line a pass
};

FramePlan make_frame_plan(const scene::Features& features, const atlas::DensitySettings& density = {});

}  // namespace tessera::server
