#include "pvs/retention.h"

#include <algorithm>
#include <functional>

namespace tessera::pvs {
namespace {

DurationNs time_of(const scene::Footprint& footprint, DurationNs keep_ns) {
  const double area = footprint.area_px2;
  if (!(area >= 0)) return keep_ns;  // true for NaN
  return std::max(keep_ns,
                  from_seconds(std::min(Retention::kMostSeconds, Retention::kKeptPx2Seconds / area)));
}

}  // namespace

scene::VisiblePatches Retention::update(TimeNs now_ns, DurationNs keep_ns,
                                        const scene::VisiblePatches& seen) {
  merge(now_ns, keep_ns, seen);
  limit_kept(now_ns - keep_ns, kMostKept * seen.size());
  scene::VisiblePatches out;
  out.reserve(entries_.size());
  for (const Entry& entry : entries_) out.push_back(entry.patch);
  return out;
}

void Retention::merge(TimeNs now_ns, DurationNs keep_ns, const scene::VisiblePatches& seen) {
  std::vector<Entry> merged;
  merged.reserve(std::max(seen.size(), entries_.size()));
  auto old = entries_.begin();
  const auto keep_old_before = [&](uint64_t patch) {
    for (; old != entries_.end() && old->patch.patch < patch; ++old) {
      // A clock that jumped back restarts the wait, so that nothing stays for ever.
      const TimeNs last_seen = std::min(old->last_seen_ns, now_ns);
      if (now_ns - last_seen <= time_of(old->patch.footprint, keep_ns))
        merged.push_back({old->patch, last_seen});
    }
  };
  for (const scene::VisiblePatch& patch : seen) {
    keep_old_before(patch.patch);
    if (old != entries_.end() && old->patch.patch == patch.patch) ++old;
    merged.push_back({patch, now_ns});
  }
  keep_old_before(uint64_t{1} << 32);
  entries_ = std::move(merged);
}

// Of those last seen before a time the newest, at most so many; of one time all or none.
void Retention::limit_kept(TimeNs kept_before_ns, size_t most) {
  std::vector<TimeNs> times;
  for (const Entry& e : entries_)
    if (e.last_seen_ns < kept_before_ns) times.push_back(e.last_seen_ns);
  if (times.size() <= most) return;
  const auto first_too_many = times.begin() + static_cast<ptrdiff_t>(most);
  std::nth_element(times.begin(), first_too_many, times.end(), std::greater<>());
  std::erase_if(entries_, [newest_dropped = *first_too_many](const Entry& e) {
    return e.last_seen_ns <= newest_dropped;
  });
}

}  // namespace tessera::pvs
