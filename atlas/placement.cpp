#include "atlas/placement.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "atlas/addressing/addressing.h"

namespace tessera::atlas {
namespace {

auto key(const Placement& p) {
  return std::tuple(p.patch, p.part);
}

uint64_t samples_of(const HalvesPlace& halves) {
  uint64_t samples = 0;
  for (const HalfPlace& half : halves.half)
    samples += addressing::staircase_samples(addressing::half_staircase(halves.across, half.along));
  return samples;
}

using Visit = std::function<void(const TexelRectangle&)>;

// A rectangle within one of `size`, as it is or turned by 180 degrees, at `at`.
void visit_within(glm::ivec2 at, glm::ivec2 size, bool turned, glm::ivec2 corner, glm::ivec2 sides,
                  const Visit& visit) {
  const glm::uvec2 first(at + (turned ? size - corner - sides : corner)), extent(sides);
  if (extent.x > 0 && extent.y > 0) visit({first.x, first.y, extent.x, extent.y});
}

void visit_ls(const Placement& p, uint32_t atlas_width, const Visit& visit) {
  const int level = p.l.level, ls = p.l.splits * p.l.splits;
  const int rows = addressing::l_full_rows(level), columns = addressing::l_full_columns(level);
  const int begin = p.l.turned, end = begin + (p.masked ? 2 * ls : ls);  // in half pairs
  for (int half = begin; half < end; ++half) {
    const glm::ivec2 pair =
        addressing::l_pair_place(half / 2, {p.x, p.y}, p.l.next_y, level, static_cast<int>(atlas_width));
    const glm::ivec2 size = addressing::l_pair_size(level);
    const bool turned = half % 2 == 1;
    visit_within(pair, size, turned, {0, 0}, {level + 1, rows}, visit);
    visit_within(pair, size, turned, {0, rows}, {columns, level + 1 - rows}, visit);
  }
}

// Stretch by stretch of equally high columns.
void visit_half(const HalfPlace& half, int across, const Visit& visit) {
  const glm::ivec2 stairs = addressing::half_staircase(across, half.along);
  const glm::ivec2 size(stairs.y + 1, stairs.x + 1);
  const int stretch = addressing::staircase_stretch(stairs);
  for (int column = 0; column <= stairs.y;) {
    const int width = column == 0 ? 1 : std::min(stretch, stairs.y + 1 - column);
    visit_within({half.x, half.y}, size, half.turned, {column, 0},
                 {width, addressing::staircase_row(column, stairs)}, visit);
    column += width;
  }
}

}  // namespace

void visit_samples(const Placement& p, uint32_t atlas_width, const Visit& visit) {
  if (p.kind == PlacementKind::block) visit({p.x, p.y, p.width, p.height});
  if (p.kind == PlacementKind::l) visit_ls(p, atlas_width, visit);
  if (p.kind == PlacementKind::halves)
    for (const HalfPlace& half : p.halves.half) visit_half(half, p.halves.across, visit);
}

SpacingCode spacing_code(double ratio) {
  const double octaves = ratio > 0 ? std::log2(ratio) : -6.0;
  if (!(octaves > -6)) return -addressing::kRatioCodeOne;  // NaN, too
  return static_cast<SpacingCode>(std::lround(addressing::kRatioCodesPerOctave * std::min(octaves, 6.0)));
}

uint64_t Placement::texels() const {
  switch (kind) {
    case PlacementKind::block:
      return uint64_t{width} * height;
    case PlacementKind::l:
      return (masked ? 2u : 1u) * uint64_t{l.splits} * l.splits * addressing::l_samples(l.level);
    case PlacementKind::halves:
      return samples_of(halves);
    case PlacementKind::color:
      break;
  }
  return 0;
}

LayoutDelta difference(std::span<const Placement> before, std::span<const Placement> after) {
  LayoutDelta delta;
  auto old = before.begin();
  // `patch` of `after` comes next: old parts of patches before it are gone.
  const auto remove_before = [&](scene::PatchId patch) {
    for (; old != before.end() && old->patch < patch; ++old)
      if (delta.removed.empty() || delta.removed.back() != old->patch) delta.removed.push_back(old->patch);
  };
  for (const Placement& placement : after) {
    remove_before(placement.patch);
    const bool known = old != before.end() && key(*old) == key(placement);
    if (!known || *old != placement) delta.changed.push_back(placement);
    if (known) ++old;
  }
  remove_before(scene::kNone);
  return delta;
}

}  // namespace tessera::atlas
