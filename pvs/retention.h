// Patches that left the visible set stay for one round trip, so that a short glance away does not move the
// atlas.
#pragma once

#include <cstdint>
#include <vector>

#include "base/time.h"
#include "scene/visible_set.h"

namespace tessera::pvs {

class Retention {
 public:
  explicit Retention(DurationNs keep_ns) : keep_ns_(keep_ns) {}
  // Returns `seen` plus the patches last seen at most keep_ns ago (with their last footprint), sorted by
  // patch.
  scene::VisiblePatches update(TimeNs now_ns, const scene::VisiblePatches& seen);

 private:
  struct Entry {
    scene::VisiblePatch patch;
    TimeNs last_seen_ns;
  };
  DurationNs keep_ns_;
  std::vector<Entry> entries_;  // sorted by patch
};

}  // namespace tessera::pvs
