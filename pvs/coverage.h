// How well a visible set foresaw what was seen (thesis 7.2.1).
#pragma once

#include <span>

#include "scene/visible_set.h"

namespace tessera::pvs {

struct Coverage {
  double seen_area = 0;    // v: area-weighted patches that were seen
  double missed_area = 0;  // f_n: seen, not in the set
  double extra_area = 0;   // f_p: in the set, never seen
  double coverage() const { return seen_area > 0 ? 1 - missed_area / seen_area : 1; }
  double overestimation() const { return seen_area > 0 ? extra_area / seen_area : 0; }
};

// Both sorted by patch; weights are footprint areas.
Coverage compare(const scene::VisiblePatches& predicted, const scene::VisiblePatches& seen);

}  // namespace tessera::pvs
