// Patches that left the visible set stay for one round trip, so that a short glance away does not move the
// atlas. Small ones stay longer: what covers a pixel or less, or shows little of itself between others, is
// hit by an id buffer's pixels in one frame and missed in the next, and costs little memory meanwhile.
#pragma once

#include <cstdint>
#include <vector>

#include "base/time.h"
#include "scene/visible_set.h"

namespace tessera::pvs {

class Retention {
 public:
  // A small patch stays for so long that its area on the screen times that time is this, at most one second.
  static constexpr double kKeptPx2Seconds = 8;
  static constexpr double kMostSeconds = 1;

  // `keep_ns`: how long every patch stays at least; not negative.
  explicit Retention(DurationNs keep_ns) : keep_ns_(keep_ns) {}
  // Returns `seen` plus the patches last seen at most their time ago (with their last footprint), sorted by
  // patch.
  scene::VisiblePatches update(TimeNs now_ns, const scene::VisiblePatches& seen);

 private:
  struct Entry {
    scene::VisiblePatch patch;
    TimeNs last_seen_ns;
  };
  DurationNs time_of(const scene::Footprint& footprint) const;

  DurationNs keep_ns_;
  std::vector<Entry> entries_;  // sorted by patch
};

}  // namespace tessera::pvs
