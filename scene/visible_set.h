// The patches that a client may need, as plain values: written by pvs/, read by atlas/.
#pragma once

#include <vector>

#include "scene/scene.h"

namespace tessera::scene {

// A patch's size on the viewer's screen, by angles seen from the eye (thesis eq. 3.1), in pixels.
struct Footprint {
  float u_px = 0;      // longest edge along the block's u axis
  float v_px = 0;      // longest edge along its v axis
  float area_px2 = 0;  // of all its triangles
};

struct VisiblePatch {
  PatchId patch;
  Footprint footprint;  // the largest over the views that the set covers
};

// Sorted by patch, without duplicates.
using VisiblePatches = std::vector<VisiblePatch>;

}  // namespace tessera::scene
