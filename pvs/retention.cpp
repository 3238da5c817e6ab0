#include "pvs/retention.h"

#include <algorithm>

namespace tessera::pvs {

scene::VisiblePatches Retention::update(TimeNs now_ns, const scene::VisiblePatches& seen) {
  std::vector<Entry> merged;
  merged.reserve(std::max(seen.size(), entries_.size()));
  auto old = entries_.begin();
  const auto keep_old_before = [&](uint64_t patch) {
    for (; old != entries_.end() && old->patch.patch < patch; ++old) {
      // A clock that jumped back restarts the wait, so that nothing stays for ever.
      const TimeNs last_seen = std::min(old->last_seen_ns, now_ns);
      if (now_ns - last_seen <= keep_ns_) merged.push_back({old->patch, last_seen});
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
