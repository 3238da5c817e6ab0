// Patches that left the visible set stay for a while, so that a short glance away does not move the atlas:
// all for one round trip, small ones longer. What covers a pixel or less is hit by an id buffer's pixels in
// one frame and missed in the next, and so is what of a small patch shows between others; keeping it costs
// little memory. Large patches of which little shows come and go as well, but would take too much.
#pragma once

#include <cstdint>
#include <vector>

#include "base/time.h"
#include "scene/visible_set.h"

namespace tessera::pvs {

class Retention {
 public:
  // A small patch stays for so long that its area (all of it, as if nothing hid it) times that time is this,
  // at most one second.
  static constexpr double kKeptPx2Seconds = 8;
  static constexpr double kMostSeconds = 1;
  // At most so many times as many as are seen stay longer than others; the longest unseen go first. A quick
  // turn would fill the atlas's lists with what is behind the viewer.
  static constexpr size_t kMostKept = 2;

  // Returns `seen` plus the patches last seen at most their time ago (with their last footprint), sorted by
  // patch. `keep_ns`: how long every patch stays, whatever its size; not negative.
  scene::VisiblePatches update(TimeNs now_ns, DurationNs keep_ns, const scene::VisiblePatches& seen);

 private:
  struct Entry {
    scene::VisiblePatch patch;
    TimeNs last_seen_ns;
  };
  void merge(TimeNs now_ns, DurationNs keep_ns, const scene::VisiblePatches& seen);
  void limit_kept(TimeNs kept_before_ns, size_t most);

  std::vector<Entry> entries_;  // sorted by patch
};

}  // namespace tessera::pvs
