#include "bench/pairing_check.h"

#include <algorithm>
#include <array>
#include <compare>
#include <initializer_list>
#include <vector>

namespace tessera::bench {
namespace {

// Longest: 4 numbers and 4 for each half.
struct Address {
  std::array<uint32_t, 12> numbers{};
  size_t count = 0;
  Address(std::initializer_list<uint32_t> list) {
    for (const uint32_t number : list) numbers[count++] = number;
  }
  void add(const auto& half) {
    for (const uint32_t number :
         {uint32_t{half.x}, uint32_t{half.y}, uint32_t{half.along}, uint32_t{half.turned}})
      numbers[count++] = number;
  }
  auto operator<=>(const Address&) const = default;
};

// Of one triangle, with the kind first; single colours count without their value, spacing is left out.
Address address_of(const client::TriangleFields& r) {
  if (r.single_color) return {0};
  if (r.corner_kind == client::kCornerL) return {1, r.x, r.y, r.l.level, r.l.splits, r.l.turned, r.l.next_y};
  if (r.corner_kind == client::kCornerHalves) {
    Address address{2, r.halves.apex, r.halves.foot, r.halves.across};
    for (const auto& half : r.halves.half) address.add(half);
    return address;
  }
  return {3, r.x, r.y, r.width, r.height, r.transposed};
}

Address address_of(const atlas::Placement& p) {
  switch (p.kind) {
    case atlas::PlacementKind::color:
      return {0};
    case atlas::PlacementKind::l:
      return {1, p.x, p.y, p.l.level, p.l.splits, p.l.turned, p.l.splits > 1 ? p.l.next_y : 0u};
    case atlas::PlacementKind::halves: {
      Address address{2, p.halves.apex, p.halves.foot, p.halves.across};
      for (const auto& half : p.halves.half) address.add(half);
      return address;
    }
    case atlas::PlacementKind::block:
      break;
  }
  return {3, p.x, p.y, p.width, p.height, p.transposed};
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
    const bool whole = p.part == atlas::kWholePatch;
    expected.insert(expected.end(), whole ? patch.triangle_count : 1u, address_of(p));
  }
  std::sort(drawn.begin(), drawn.end());
  std::sort(expected.begin(), expected.end());
  return drawn == expected;
}

}  // namespace tessera::bench
