#include "pvs/retention.h"

#include <algorithm>

namespace tessera::pvs {

DurationNs Retention::time_of(const scene::Footprint& footprint) const {
  const double area = footprint.area_px2;
  const bool is_small = area * kMostSeconds <= kKeptPx2Seconds;  // false for NaN
  const double seconds = is_small ? kMostSeconds : kKeptPx2Seconds / area;
  return seconds > 0 ? std::max(keep_ns_, from_seconds(seconds)) : keep_ns_;
}

scene::VisiblePatches Retention::update(TimeNs now_ns, const scene::VisiblePatches& seen) {
  std::vector<Entry> merged;
  merged.reserve(std::max(seen.size(), entries_.size()));
  auto old = entries_.begin();
  const auto keep_old_before = [&](uint64_t patch) {
    for (; old != entries_.end() && old->patch.patch < patch; ++old) {
      // A clock that jumped back restarts the wait, so that nothing stays for ever.
      const TimeNs last_seen = std::min(old->last_seen_ns, now_ns);
      if (now_ns - last_seen <= time_of(old->patch.footprint)) merged.push_back({old->patch, last_seen});
    }
  };
  for (const scene::VisiblePatch& patch : seen) {
    keep_old_before(patch.patch);
    if (old != entries_.end() && old->patch.patch == patch.patch) ++old;
    merged.push_back({patch, now_ns});
  }
  keep_old_before(uint64_t{1} << 32);
  entries_ = std::move(merged);

  scene::VisiblePatches out;
  out.reserve(entries_.size());
  for (const Entry& entry : entries_) out.push_back(entry.patch);
  return out;
}

}  // namespace tessera::pvs
