#include "atlas/placement.h"

namespace tessera::atlas {

LayoutDelta difference(std::span<const Placement> before, std::span<const Placement> after) {
  LayoutDelta delta;
  auto old = before.begin();
  for (const Placement& placement : after) {
    for (; old != before.end() && old->patch < placement.patch; ++old) delta.removed.push_back(old->patch);
    const bool known = old != before.end() && old->patch == placement.patch;
    if (!known || *old != placement) delta.changed.push_back(placement);
    if (known) ++old;
  }
  for (; old != before.end(); ++old) delta.removed.push_back(old->patch);
  return delta;
}

}  // namespace tessera::atlas
