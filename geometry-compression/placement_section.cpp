// Placements: which patches, and where their samples lie. Blocks often stand one after another; those of
// power-of-two sides mostly on multiples of their sides.
#include <algorithm>
#include <array>
#include <bit>
#include <tuple>

#include "geometry-compression/columns.h"
#include "geometry-compression/sections.h"

namespace tessera::geometry_compression {
namespace {

constexpr uint32_t kMaxPosition = 8192;

// `kind` on the wire: the frequent ones, of whole patches and of triangles, are 0.
constexpr PlacementKind kKinds[] = {PlacementKind::block, PlacementKind::none, PlacementKind::color};
constexpr PlacementKind kPartKinds[] = {PlacementKind::l, PlacementKind::halves, PlacementKind::color};

uint32_t coded_kind(const PatchPlacement& p) {
  const auto& kinds = p.part == 0 ? kKinds : kPartKinds;
  return static_cast<uint32_t>(std::find(std::begin(kinds), std::end(kinds), p.kind) - std::begin(kinds));
}

constexpr uint32_t kParts = 4;

// Rules for a block's position: spelled out, or touching the block before on its right or its lower side.
enum PositionRule : uint32_t { kSpelledOut = 0, kRightOf = 1, kBelow = 2 };

PositionRule rule_for(const PatchPlacement& block, const PatchPlacement& previous) {
  if (block.y == previous.y && block.x == previous.x + previous.width) return kRightOf;
  if (block.x == previous.x && block.y == previous.y + previous.height) return kBelow;
  return kSpelledOut;
}

// What all blocks of the packet have in common.
struct Grid {
  bool powers_of_two = false;  // sides
  bool aligned = false;        // positions to sides, which are powers of two; else to 2 texels
  uint32_t x_zeros(const PatchPlacement& p) const { return aligned ? log2_of(p.width) : 1; }
  uint32_t y_zeros(const PatchPlacement& p) const { return aligned ? log2_of(p.height) : 1; }
  // A side as a small number, and back.
  uint32_t code(uint16_t side) const { return powers_of_two ? log2_of(side) - 1 : side / 2u - 1; }
  uint64_t side(uint32_t code) const {
    return powers_of_two ? uint64_t{2} << std::min(code, 32u) : 2 * (uint64_t{code} + 1);
  }

 private:
  static uint32_t log2_of(uint16_t side) { return static_cast<uint32_t>(std::countr_zero(side)); }
};

Grid grid_of(std::span<const PatchPlacement> placements) {
  Grid grid{true, true};
  for (const PatchPlacement& p : placements) {
    if (p.kind != PlacementKind::block) continue;
    grid.powers_of_two &= std::has_single_bit(p.width) && std::has_single_bit(p.height);
    grid.aligned &= grid.powers_of_two && p.x % p.width == 0 && p.y % p.height == 0;
  }
  grid.aligned &= grid.powers_of_two;
  return grid;
}

// Before the first block.
PatchPlacement origin() {
  PatchPlacement p;
  p.width = p.height = 2;
  return p;
}

constexpr size_t kSpacings = std::tuple_size_v<decltype(PatchPlacement::spacing)>;

// Distances change about linearly over a patch: the far corners follow from the near ones.
int predicted_spacing(const PatchPlacement& p, size_t corner) {
  return corner == 2 ? p.spacing[0] + p.spacing[1] : corner == 3 ? p.spacing[2] + p.spacing[0] : 0;
}

struct BlockColumns {
  std::vector<uint32_t> width, height, transposed, rule, x, y;
  std::array<std::vector<uint32_t>, kSpacings> spacing;
};

void add_spacing(BlockColumns& c, const PatchPlacement& p) {
  for (size_t i = 0; i < kSpacings; ++i)
    c.spacing[i].push_back(
        delta(static_cast<uint32_t>(p.spacing[i]), static_cast<uint32_t>(predicted_spacing(p, i))));
}

void write_blocks(BitWriter& out, std::span<const PatchPlacement> placements) {
  const Grid grid = grid_of(placements);
  BlockColumns c;
  bool spaced = false;
  PatchPlacement previous = origin();
  for (const PatchPlacement& p : placements) {
    if (p.kind != PlacementKind::block) continue;
    c.width.push_back(delta(grid.code(p.width), grid.code(previous.width)));
    // Blocks are nearly square.
    c.height.push_back(delta(grid.code(p.height), grid.code(p.width)));
    c.transposed.push_back(p.transposed);
    const PositionRule rule = rule_for(p, previous);
    c.rule.push_back(rule);
    if (rule == kSpelledOut) {
      c.x.push_back(p.x >> grid.x_zeros(p));
      c.y.push_back(p.y >> grid.y_zeros(p));
    }
    add_spacing(c, p);
    spaced |= p.spacing != decltype(p.spacing){};
    previous = p;
  }
  out.put(grid.powers_of_two, 1);
  out.put(grid.aligned, 1);
  out.put(spaced, 1);
  for (const auto* column : {&c.width, &c.height, &c.transposed, &c.rule, &c.x, &c.y})
    write_column(out, *column);
  if (!spaced) return;
  for (const auto& column : c.spacing) write_column(out, column);
}

// From one colour to the next mostly brightness changes, so red and blue go with green; and most of the rest
// lies between warm and cold light, where blue loses what red gains.
class ColorPrediction {
 public:
  // The channels in the order that they are coded in, as shifts in PatchPlacement::rgb.
  static constexpr uint32_t kShifts[] = {8, 0, 16};

  // Of channel `i` of kShifts, from those before it. Wraps modulo 2^32.
  uint32_t next(size_t i) const {
    return previous_[i] + (i == 0 ? 0 : i == 1 ? change_[0] : 2 * change_[0] - change_[1]);
  }
  void is(size_t i, uint32_t channel) {
    change_[i] = channel - previous_[i];
    previous_[i] = channel;
  }

 private:
  std::array<uint32_t, 3> previous_{}, change_{};
};

using ColorColumns = std::array<std::vector<uint32_t>, std::size(ColorPrediction::kShifts)>;

void write_colors(BitWriter& out, std::span<const PatchPlacement> placements) {
  ColorColumns columns;
  ColorPrediction prediction;
  for (const PatchPlacement& p : placements) {
    if (p.kind != PlacementKind::color) continue;
    for (size_t i = 0; i < columns.size(); ++i) {
      const uint32_t channel = (p.rgb >> ColorPrediction::kShifts[i]) & 0xff;
      columns[i].push_back(delta(channel, prediction.next(i)));
      prediction.is(i, channel);
    }
  }
  for (const auto& column : columns) write_column(out, column);
}

BlockColumns read_block_columns(BitReader& in, uint32_t count, bool spaced) {
  BlockColumns c;
  c.width = read_column(in, count);
  c.height = read_column(in, count);
  c.transposed = read_column(in, count);
  c.rule = read_column(in, count);
  const auto spelled_out = static_cast<uint32_t>(std::count(c.rule.begin(), c.rule.end(), kSpelledOut));
  c.x = read_column(in, spelled_out);
  c.y = read_column(in, spelled_out);
  for (auto& column : c.spacing) column = spaced ? read_column(in, count) : std::vector<uint32_t>(count);
  return c;
}

// The readers below give an empty string, or what is wrong with block number `i` of `c`.

std::string read_size(const BlockColumns& c, size_t i, Grid grid, const PatchPlacement& previous,
                      PatchPlacement& p) {
  const uint32_t width_code = undelta(c.width[i], grid.code(previous.width));
  const uint64_t width = grid.side(width_code), height = grid.side(undelta(c.height[i], width_code));
  if (width > kMaxBlockSide || height > kMaxBlockSide)
    return "a block's side is not 2.." + std::to_string(kMaxBlockSide);
  p.width = static_cast<uint16_t>(width);
  p.height = static_cast<uint16_t>(height);
  return {};
}

std::string read_position(const BlockColumns& c, size_t i, size_t& next_position, Grid grid,
                          const PatchPlacement& previous, PatchPlacement& p) {
  if (c.transposed[i] > 1 || c.rule[i] > kBelow) return "unknown flag or position rule";
  p.transposed = c.transposed[i] != 0;
  uint64_t x = previous.x, y = previous.y;
  if (c.rule[i] == kSpelledOut) {
    x = uint64_t{c.x[next_position]} << grid.x_zeros(p);
    y = uint64_t{c.y[next_position]} << grid.y_zeros(p);
    ++next_position;
  } else if (c.rule[i] == kRightOf) {
    x += previous.width;
  } else {
    y += previous.height;
  }
  if (x >= kMaxPosition || y >= kMaxPosition) return "a block's position is not below 8192";
  p.x = static_cast<uint16_t>(x);
  p.y = static_cast<uint16_t>(y);
  return {};
}

std::string read_spacing(const BlockColumns& c, size_t i, bool spaced, PatchPlacement& p) {
  if (!spaced) return {};
  for (size_t corner = 0; corner < kSpacings; ++corner) {
    const auto code = static_cast<int32_t>(
        undelta(c.spacing[corner][i], static_cast<uint32_t>(predicted_spacing(p, corner))));
    if (code < -126 || code > 126) return "a block's spacing is not -126..126";
    p.spacing[corner] = static_cast<int8_t>(code);
  }
  return {};
}

std::string read_blocks(BitReader& in, uint32_t count, std::vector<PatchPlacement>& placements) {
  Grid grid;
  grid.powers_of_two = in.get(1) != 0;
  grid.aligned = in.get(1) != 0;
  const bool spaced = in.get(1) != 0;
  if (grid.aligned && !grid.powers_of_two) return "blocks are aligned to sides that are no powers of two";
  const BlockColumns columns = read_block_columns(in, count, spaced);
  if (!in.ok()) return {};
  PatchPlacement previous = origin();
  size_t next_block = 0, next_position = 0;
  for (PatchPlacement& p : placements) {
    if (p.kind != PlacementKind::block) continue;
    std::string error = read_size(columns, next_block, grid, previous, p);
    if (error.empty()) error = read_position(columns, next_block, next_position, grid, previous, p);
    if (error.empty()) error = read_spacing(columns, next_block, spaced, p);
    if (!error.empty()) return "placement of patch " + std::to_string(p.patch) + ": " + error;
    ++next_block;
    previous = p;
  }
  return {};
}

std::string read_colors(BitReader& in, uint32_t count, std::vector<PatchPlacement>& placements) {
  ColorColumns columns;
  for (auto& column : columns) column = read_column(in, count);
  if (!in.ok()) return {};
  ColorPrediction prediction;
  size_t next = 0;
  for (PatchPlacement& p : placements) {
    if (p.kind != PlacementKind::color) continue;
    for (size_t i = 0; i < columns.size(); ++i) {
      const uint32_t channel = undelta(columns[i][next], prediction.next(i));
      if (channel > 255) return "placement of patch " + std::to_string(p.patch) + ": a colour is not 0..255";
      p.rgb |= channel << ColorPrediction::kShifts[i];
      prediction.is(i, channel);
    }
    ++next;
  }
  return {};
}

// Patch and part as one number, which grows from placement to placement.
uint64_t key_of(const PatchPlacement& p, bool has_parts) {
  return has_parts ? uint64_t{kParts} * p.patch + p.part : p.patch;
}

uint32_t count_of(std::span<const PatchPlacement> placements, PlacementKind kind) {
  return static_cast<uint32_t>(
      std::count_if(placements.begin(), placements.end(), [=](const auto& p) { return p.kind == kind; }));
}

// Which patches and parts, and of what kind.
void write_keys(BitWriter& out, std::span<const PatchPlacement> placements, bool has_parts) {
  std::vector<uint32_t> gaps, kinds;
  uint64_t next = 0;
  for (const PatchPlacement& p : placements) {
    gaps.push_back(static_cast<uint32_t>(key_of(p, has_parts) - next));
    kinds.push_back(coded_kind(p));
    next = key_of(p, has_parts) + 1;
  }
  write_column(out, gaps);
  write_column(out, kinds);
}

std::string read_keys(BitReader& in, uint32_t count, bool has_parts,
                      std::vector<PatchPlacement>& placements) {
  const auto gaps = read_column(in, count);
  const auto kinds = read_column(in, count);
  if (!in.ok()) return {};
  placements.resize(count);
  uint64_t next = 0;
  for (uint32_t i = 0; i < count; ++i) {
    const uint64_t key = next + gaps[i];
    const uint64_t patch = has_parts ? key / kParts : key;
    if (key > UINT32_MAX || kinds[i] >= std::size(kKinds))
      return "placement " + std::to_string(i) +
             ": its patch and part do not fit in 32 bits, or its kind is unknown";
    placements[i].patch = static_cast<uint32_t>(patch);
    placements[i].part = has_parts ? static_cast<uint8_t>(key % kParts) : uint8_t{0};
    placements[i].kind = placements[i].part == 0 ? kKinds[kinds[i]] : kPartKinds[kinds[i]];
    next = key + 1;
  }
  return {};
}

}  // namespace

void write_placements(BitWriter& out, std::span<const PatchPlacement> placements) {
  const bool has_parts =
      std::any_of(placements.begin(), placements.end(), [](const auto& p) { return p.part != 0; });
  out.put(has_parts, 1);
  write_keys(out, placements, has_parts);
  write_blocks(out, placements);
  if (has_parts) write_triangle_placements(out, placements);
  write_colors(out, placements);
}

std::string read_placements(BitReader& in, uint32_t count, std::vector<PatchPlacement>& placements) {
  const bool has_parts = in.get(1) != 0;
  if (std::string error = read_keys(in, count, has_parts, placements); !error.empty() || !in.ok())
    return error;
  const uint32_t blocks = count_of(placements, PlacementKind::block);
  if (std::string error = read_blocks(in, blocks, placements); !error.empty() || !in.ok()) return error;
  if (has_parts) {
    if (std::string error = read_triangle_placements(in, placements); !error.empty() || !in.ok())
      return error;
  }
  return read_colors(in, count_of(placements, PlacementKind::color), placements);
}

}  // namespace tessera::geometry_compression
