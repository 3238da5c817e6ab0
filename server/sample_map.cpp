#include "server/sample_map.h"

namespace tessera::server {

void map_samples(std::span<const atlas::Placement> placements, codec::Occupancy& used) {
  used.clear();
  for (const atlas::Placement& p : placements)
    if (p.kind == atlas::PlacementKind::block) used.add_rectangle(p.x, p.y, p.width, p.height);
}

}  // namespace tessera::server
