#include "pvs/coverage.h"

namespace tessera::pvs {

Coverage compare(const scene::VisiblePatches& predicted, const scene::VisiblePatches& seen) {
  Coverage out;
  auto p = predicted.begin();
  for (const scene::VisiblePatch& s : seen) {
    for (; p != predicted.end() && p->patch < s.patch; ++p) out.extra_area += p->footprint.area_px2;
    out.seen_area += s.footprint.area_px2;
    if (p != predicted.end() && p->patch == s.patch) {
      ++p;
    } else {
      out.missed_area += s.footprint.area_px2;
    }
  }
  for (; p != predicted.end(); ++p) out.extra_area += p->footprint.area_px2;
  return out;
}

}  // namespace tessera::pvs
