#include "server/sample_map.h"

namespace tessera::server {

void map_samples(std::span<const atlas::Placement> placements, codec::Occupancy& used) {
  used.clear();
  for (const atlas::Placement& p : placements)
    atlas::visit_samples(p, used.width(), [&](const atlas::TexelRectangle& r) {
      used.add_rectangle(r.x, r.y, r.width, r.height);
    });
}

}  // namespace tessera::server
