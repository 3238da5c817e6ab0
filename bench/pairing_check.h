// Checks a pair that the client is about to draw against what the server laid out for that frame.
#pragma once

#include <span>

#include "atlas/placement.h"
#include "client-sdk/scene_state.h"
#include "scene/scene.h"

namespace tessera::bench {

// True if the client's records are exactly the triangles of `placements` with their addresses (colours may be
// older).
bool matches(const client::SceneState& state, std::span<const atlas::Placement> placements,
             const scene::Scene& scene);

}  // namespace tessera::bench
