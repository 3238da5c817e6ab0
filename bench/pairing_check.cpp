#include "bench/pairing_check.h"

#include <algorithm>
#include <tuple>
#include <vector>

namespace tessera::bench {
namespace {

// Address of one triangle; single colours count without their value.
using Address = std::tuple<bool, uint16_t, uint16_t, uint16_t, uint16_t, bool>;

Address address_of(const client::TriangleFields& r) {
  if (r.single_color) return {true, 0, 0, 0, 0, false};
  return {false, r.x, r.y, r.width, r.height, r.transposed};
}

Address address_of(const atlas::Placement& p) {
  if (p.kind == atlas::PlacementKind::color) return {true, 0, 0, 0, 0, false};
  return {false, p.x, p.y, p.width, p.height, p.transposed};
}

}  // namespace

bool matches(const client::SceneState& state, std::span<const atlas::Placement> placements,
             const scene::Scene& scene) {
  std::vector<Address> drawn, expected;
  for (const auto& group : state.records) {
    for (const client::TriangleRecord& record : group) drawn.push_back(address_of(client::unpack(record)));
  }
  uint32_t instance = 0;
  for (const atlas::Placement& p : placements) {
    while (instance + 1 < scene.instances.size() && scene.instances[instance + 1].first_patch <= p.patch)
      ++instance;
    const scene::Instance& placed = scene.instances[instance];
    const auto& patch = scene.geometries[placed.geometry].patches[p.patch - placed.first_patch];
    expected.insert(expected.end(), patch.triangle_count, address_of(p));
  }
  std::sort(drawn.begin(), drawn.end());
  std::sort(expected.begin(), expected.end());
  return drawn == expected;
}

}  // namespace tessera::bench
