// Placements of single triangles: Ls and halves. A frame places them anew, level by level and width by width,
// so that one follows from the one before it in its bin.
#include <algorithm>
#include <array>

#include "geometry-compression/columns.h"
#include "geometry-compression/sections.h"

namespace tessera::geometry_compression {
namespace {

constexpr uint32_t kMaxPosition = 8192;

// Where an L may be: in the other half of the pair of the last one of its level, or in the pair beside it.
enum LRule : uint32_t { kOtherHalf = 0, kNextPair = 1, kSpelledOut = 2 };

// Columns and rows of texels between pairs: pairs are as wide as an L and its full columns, and so high that
// both fit, in even numbers (atlas/addressing/split.glsl).
uint16_t pair_pitch(uint8_t level) {
  const int width = level + 1 + level / 2 + 1 + level % 2;
  return static_cast<uint16_t>(width + width % 2);
}

// The tables below have room for every number of their byte, also for those out of range: a frame with one
// makes a packet that readers refuse, no worse.
constexpr size_t kBytes = 256;

// The last L of each level.
class LastLs {
 public:
  LRule rule_for(const PatchPlacement& p) const {
    PatchPlacement guess = p;
    for (const LRule rule : {kOtherHalf, kNextPair})
      if (apply(rule, guess) && guess.x == p.x && guess.y == p.y && guess.l.turned == p.l.turned) return rule;
    return kSpelledOut;
  }
  // Sets x, y and turned of `p` by its level; false if there is none to follow.
  bool apply(LRule rule, PatchPlacement& p) const {
    const Place& last = last_[p.l.level];
    if (!last.known) return false;
    p.x = static_cast<uint16_t>(last.x + (rule == kNextPair ? pair_pitch(p.l.level) : 0));
    p.y = last.y;
    p.l.turned = rule == kOtherHalf && !last.turned;
    return true;
  }
  void set(const PatchPlacement& p) { last_[p.l.level] = {p.x, p.y, p.l.turned, true}; }

 private:
  struct Place {
    uint16_t x = 0, y = 0;
    bool turned = false, known = false;
  };
  std::array<Place, kBytes> last_{};
};

// The last half of each width.
class LastHalves {
 public:
  HalfPlacement& of(uint8_t across, uint16_t along) {
    return last_[std::min(static_cast<size_t>(across), static_cast<size_t>(along))];
  }

 private:
  std::array<HalfPlacement, kBytes> last_{};
};

using Column = std::vector<uint32_t>;

struct LColumns {
  Column level, splits, rule, x, y, turned, next_y;
};

struct HalvesColumns {
  Column apex, foot, across;
  // Of both halves in turn.
  Column along, x, y, turned;
};

LColumns l_columns(std::span<const PatchPlacement> placements) {
  LColumns c;
  LastLs last;
  uint32_t level = 1;
  for (const PatchPlacement& p : placements) {
    if (p.kind != PlacementKind::l) continue;
    c.level.push_back(delta(p.l.level, level));
    level = p.l.level;
    c.splits.push_back(p.l.splits - 1u);
    if (p.l.splits > 1) c.next_y.push_back(p.l.next_y / 2u);
    const LRule rule = last.rule_for(p);
    c.rule.push_back(rule);
    if (rule == kSpelledOut) {
      c.x.push_back(p.x / 2u);
      c.y.push_back(p.y / 2u);
      c.turned.push_back(p.l.turned);
    }
    last.set(p);
  }
  return c;
}

HalvesColumns halves_columns(std::span<const PatchPlacement> placements) {
  HalvesColumns c;
  LastHalves last;
  uint32_t across = 1, along = 1;
  for (const PatchPlacement& p : placements) {
    if (p.kind != PlacementKind::halves) continue;
    c.apex.push_back(p.halves.apex);
    c.foot.push_back(p.halves.foot);
    c.across.push_back(delta(p.halves.across, across));
    across = p.halves.across;
    for (const HalfPlacement& half : p.halves.half) {
      HalfPlacement& before = last.of(p.halves.across, half.along);
      c.along.push_back(delta(half.along, along));
      along = half.along;
      c.x.push_back(delta(half.x, before.x));
      c.y.push_back(delta(half.y / 2u, before.y / 2u));
      c.turned.push_back(half.turned == before.turned);
      before = half;
    }
  }
  return c;
}

void write_spacing(BitWriter& out, std::span<const PatchPlacement> placements) {
  for (size_t corner = 0; corner < 2; ++corner) {
    Column column;
    for (const PatchPlacement& p : placements)
      if (p.part != 0 && p.kind != PlacementKind::color) column.push_back(zigzag(p.spacing[corner]));
    write_column(out, column);
  }
}

std::string of_patch(const PatchPlacement& p, const char* what) {
  return "placement of patch " + std::to_string(p.patch) + ", triangle " + std::to_string(p.part) + ": " +
         what;
}

std::string read_ls(BitReader& in, std::span<PatchPlacement> placements) {
  const auto count = static_cast<uint32_t>(std::count_if(
      placements.begin(), placements.end(), [](const auto& p) { return p.kind == PlacementKind::l; }));
  LColumns c;
  c.level = read_column(in, count);
  c.splits = read_column(in, count);
  const auto split = static_cast<uint32_t>(
      std::count_if(c.splits.begin(), c.splits.end(), [](uint32_t s) { return s > 0; }));
  c.next_y = read_column(in, split);
  c.rule = read_column(in, count);
  const auto spelled_out = static_cast<uint32_t>(std::count(c.rule.begin(), c.rule.end(), kSpelledOut));
  for (Column* column : {&c.x, &c.y, &c.turned}) *column = read_column(in, spelled_out);
  if (!in.ok()) return {};

  LastLs last;
  uint32_t level = 1;
  size_t i = 0, next_split = 0, next_place = 0;
  for (PatchPlacement& p : placements) {
    if (p.kind != PlacementKind::l) continue;
    level = undelta(c.level[i], level);
    if (level < 1 || level > kMaxLevel) return of_patch(p, "its level is not 1..64");
    if (c.splits[i] >= kMaxSplits) return of_patch(p, "it is split more than 31 times");
    p.l.level = static_cast<uint8_t>(level);
    p.l.splits = static_cast<uint8_t>(c.splits[i] + 1);
    if (p.l.splits > 1) {
      if (c.next_y[next_split] >= kMaxPosition / 2) return of_patch(p, "its next row is not below 8192");
      p.l.next_y = static_cast<uint16_t>(2 * c.next_y[next_split++]);
    }
    if (c.rule[i] > kSpelledOut) return of_patch(p, "unknown position rule");
    if (c.rule[i] == kSpelledOut) {
      if (c.x[next_place] >= kMaxPosition / 2 || c.y[next_place] >= kMaxPosition / 2 ||
          c.turned[next_place] > 1)
        return of_patch(p, "its position is not below 8192");
      p.x = static_cast<uint16_t>(2 * c.x[next_place]);
      p.y = static_cast<uint16_t>(2 * c.y[next_place]);
      p.l.turned = c.turned[next_place++] != 0;
    } else if (!last.apply(static_cast<LRule>(c.rule[i]), p) || p.x >= kMaxPosition) {
      return of_patch(p, "it follows an L that there is not, or leaves the atlas");
    }
    last.set(p);
    ++i;
  }
  return {};
}

std::string read_halves(BitReader& in, std::span<PatchPlacement> placements) {
  const auto count = static_cast<uint32_t>(std::count_if(
      placements.begin(), placements.end(), [](const auto& p) { return p.kind == PlacementKind::halves; }));
  HalvesColumns c;
  for (Column* column : {&c.apex, &c.foot, &c.across}) *column = read_column(in, count);
  for (Column* column : {&c.along, &c.x, &c.y, &c.turned}) *column = read_column(in, 2 * count);
  if (!in.ok()) return {};

  LastHalves last;
  uint32_t across = 1, along = 1;
  size_t i = 0;
  for (PatchPlacement& p : placements) {
    if (p.kind != PlacementKind::halves) continue;
    across = undelta(c.across[i], across);
    if (c.apex[i] > 2 || c.foot[i] >= kFeet || across < 1 || across > kMaxHalfWidth)
      return of_patch(p, "its apex, foot or width is out of range");
    p.halves.apex = static_cast<uint8_t>(c.apex[i]);
    p.halves.foot = static_cast<uint8_t>(c.foot[i]);
    p.halves.across = static_cast<uint8_t>(across);
    for (size_t h = 0; h < 2; ++h) {
      const size_t at = 2 * i + h;
      along = undelta(c.along[at], along);
      if (along < 1 || along > kMaxHalfLength) return of_patch(p, "a half's length is not 1..1024");
      HalfPlacement& before = last.of(p.halves.across, static_cast<uint16_t>(along));
      const uint32_t x = undelta(c.x[at], before.x), half_y = undelta(c.y[at], before.y / 2u);
      if (x >= kMaxPosition || half_y >= kMaxPosition / 2 || c.turned[at] > 1)
        return of_patch(p, "a half's position is not below 8192");
      before = p.halves.half[h] = {static_cast<uint16_t>(x), static_cast<uint16_t>(2 * half_y),
                                   static_cast<uint16_t>(along), (c.turned[at] != 0) == before.turned};
    }
    ++i;
  }
  return {};
}

std::string read_spacing(BitReader& in, std::span<PatchPlacement> placements) {
  const auto is_placed = [](const PatchPlacement& p) {
    return p.part != 0 && p.kind != PlacementKind::color;
  };
  const auto count = static_cast<uint32_t>(std::count_if(placements.begin(), placements.end(), is_placed));
  for (size_t corner = 0; corner < 2; ++corner) {
    const Column column = read_column(in, count);
    if (!in.ok()) return {};
    size_t i = 0;
    for (PatchPlacement& p : placements) {
      if (!is_placed(p)) continue;
      const int32_t code = unzigzag(column[i++]);
      if (code < -126 || code > 126) return of_patch(p, "its spacing is not -126..126");
      p.spacing[corner] = static_cast<int8_t>(code);
    }
  }
  return {};
}

}  // namespace

void write_triangle_placements(BitWriter& out, std::span<const PatchPlacement> placements) {
  const LColumns l = l_columns(placements);
  for (const Column* column : {&l.level, &l.splits, &l.next_y, &l.rule, &l.x, &l.y, &l.turned})
    write_column(out, *column);
  const HalvesColumns h = halves_columns(placements);
  for (const Column* column : {&h.apex, &h.foot, &h.across, &h.along, &h.x, &h.y, &h.turned})
    write_column(out, *column);
  write_spacing(out, placements);
}

std::string read_triangle_placements(BitReader& in, std::span<PatchPlacement> placements) {
  for (const auto read : {read_ls, read_halves, read_spacing})
    if (std::string error = read(in, placements); !error.empty() || !in.ok()) return error;
  return {};
}

}  // namespace tessera::geometry_compression
