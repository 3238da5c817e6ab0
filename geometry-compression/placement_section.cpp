// Placements: which patches, and where their samples lie. Blocks of power-of-two sides mostly stand on
// multiples of their sides, and one after another.
#include <algorithm>

#include "geometry-compression/columns.h"
#include "geometry-compression/sections.h"

namespace tessera::geometry_compression {
namespace {

constexpr uint32_t kMaxPosition = 8192;
constexpr uint32_t kMinLog = 1, kMaxLog = 8;

// `kind` on the wire: the frequent one is 0.
constexpr uint32_t coded_kind(PlacementKind kind) {
  return kind == PlacementKind::block ? 0 : kind == PlacementKind::none ? 1 : 2;
}
constexpr PlacementKind kKinds[] = {PlacementKind::block, PlacementKind::none, PlacementKind::color};

// Rules for a block's position: spelled out, or touching the block before on its right or its lower side.
enum PositionRule : uint32_t { kSpelledOut = 0, kRightOf = 1, kBelow = 2 };

PositionRule rule_for(const PatchPlacement& block, const PatchPlacement& previous) {
  if (block.y == previous.y && block.x == previous.x + (1u << previous.log_w)) return kRightOf;
  if (block.x == previous.x && block.y == previous.y + (1u << previous.log_h)) return kBelow;
  return kSpelledOut;
}

// How many low bits of a position are zero for every block of these sides in the packet.
struct Alignment {
  bool to_sides = false;  // else to 2 texels
  uint32_t x(const PatchPlacement& p) const { return to_sides ? p.log_w : 1; }
  uint32_t y(const PatchPlacement& p) const { return to_sides ? p.log_h : 1; }
};

Alignment alignment_of(std::span<const PatchPlacement> placements) {
  return {std::all_of(placements.begin(), placements.end(), [](const PatchPlacement& p) {
    return p.kind != PlacementKind::block || (p.x % (1u << p.log_w) == 0 && p.y % (1u << p.log_h) == 0);
  })};
}

// Before the first block.
PatchPlacement origin() {
  PatchPlacement p;
  p.log_w = p.log_h = kMinLog;
  return p;
}

struct BlockColumns {
  std::vector<uint32_t> log_w, log_h, transposed, rule, x, y;
};

void write_blocks(BitWriter& out, std::span<const PatchPlacement> placements) {
  const Alignment alignment = alignment_of(placements);
  BlockColumns c;
  PatchPlacement previous = origin();
  for (const PatchPlacement& p : placements) {
    if (p.kind != PlacementKind::block) continue;
    c.log_w.push_back(delta(p.log_w, previous.log_w));
    // Blocks are nearly square.
    c.log_h.push_back(delta(p.log_h, p.log_w));
    c.transposed.push_back(p.transposed);
    const PositionRule rule = rule_for(p, previous);
    c.rule.push_back(rule);
    if (rule == kSpelledOut) {
      c.x.push_back(p.x >> alignment.x(p));
      c.y.push_back(p.y >> alignment.y(p));
    }
    previous = p;
  }
  out.put(alignment.to_sides, 1);
  write_column(out, c.log_w);
  write_column(out, c.log_h);
  write_column(out, c.transposed);
  write_column(out, c.rule);
  write_column(out, c.x);
  write_column(out, c.y);
}

void write_colors(BitWriter& out, std::span<const PatchPlacement> placements) {
  for (uint32_t shift : {0, 8, 16}) {
    std::vector<uint32_t> column;
    uint32_t previous = 0;
    for (const PatchPlacement& p : placements) {
      if (p.kind != PlacementKind::color) continue;
      const uint32_t channel = (p.rgb >> shift) & 0xff;
      column.push_back(delta(channel, previous));
      previous = channel;
    }
    write_column(out, column);
  }
}

BlockColumns read_block_columns(BitReader& in, uint32_t count) {
  BlockColumns c;
  c.log_w = read_column(in, count);
  c.log_h = read_column(in, count);
  c.transposed = read_column(in, count);
  c.rule = read_column(in, count);
  const auto spelled_out = static_cast<uint32_t>(std::count(c.rule.begin(), c.rule.end(), kSpelledOut));
  c.x = read_column(in, spelled_out);
  c.y = read_column(in, spelled_out);
  return c;
}

// Empty, or what is wrong with block number `i` of `c`.
std::string read_block(const BlockColumns& c, size_t i, size_t& next_position, Alignment alignment,
                       const PatchPlacement& previous, PatchPlacement& p) {
  const uint32_t log_w = undelta(c.log_w[i], previous.log_w);
  const uint32_t log_h = undelta(c.log_h[i], log_w);
  if (log_w < kMinLog || log_w > kMaxLog || log_h < kMinLog || log_h > kMaxLog)
    return "a block's log is not 1..8";
  if (c.transposed[i] > 1 || c.rule[i] > kBelow) return "unknown flag or position rule";
  p.log_w = static_cast<uint8_t>(log_w);
  p.log_h = static_cast<uint8_t>(log_h);
  p.transposed = c.transposed[i] != 0;
  uint64_t x = previous.x, y = previous.y;
  if (c.rule[i] == kSpelledOut) {
    x = uint64_t{c.x[next_position]} << alignment.x(p);
    y = uint64_t{c.y[next_position]} << alignment.y(p);
    ++next_position;
  } else if (c.rule[i] == kRightOf) {
    x += 1u << previous.log_w;
  } else {
    y += 1u << previous.log_h;
  }
  if (x >= kMaxPosition || y >= kMaxPosition) return "a block's position is not below 8192";
  p.x = static_cast<uint16_t>(x);
  p.y = static_cast<uint16_t>(y);
  return {};
}

std::string read_blocks(BitReader& in, uint32_t count, std::vector<PatchPlacement>& placements) {
  const Alignment alignment{in.get(1) != 0};
  const BlockColumns columns = read_block_columns(in, count);
  if (!in.ok()) return {};
  PatchPlacement previous = origin();
  size_t next_block = 0, next_position = 0;
  for (PatchPlacement& p : placements) {
    if (p.kind != PlacementKind::block) continue;
    if (std::string error = read_block(columns, next_block++, next_position, alignment, previous, p);
        !error.empty())
      return "placement of patch " + std::to_string(p.patch) + ": " + error;
    previous = p;
  }
  return {};
}

std::string read_colors(BitReader& in, uint32_t count, std::vector<PatchPlacement>& placements) {
  for (uint32_t shift : {0, 8, 16}) {
    const auto column = read_column(in, count);
    if (!in.ok()) return {};
    uint32_t channel = 0;
    size_t next = 0;
    for (PatchPlacement& p : placements) {
      if (p.kind != PlacementKind::color) continue;
      channel = undelta(column[next++], channel);
      if (channel > 255) return "placement of patch " + std::to_string(p.patch) + ": a colour is not 0..255";
      p.rgb |= channel << shift;
    }
  }
  return {};
}

}  // namespace

void write_placements(BitWriter& out, std::span<const PatchPlacement> placements) {
  std::vector<uint32_t> gaps, kinds;
  uint32_t next = 0;
  for (const PatchPlacement& p : placements) {
    gaps.push_back(p.patch - next);
    kinds.push_back(coded_kind(p.kind));
    next = p.patch + 1;
  }
  write_column(out, gaps);
  write_column(out, kinds);
  write_blocks(out, placements);
  write_colors(out, placements);
}

std::string read_placements(BitReader& in, uint32_t count, std::vector<PatchPlacement>& placements) {
  const auto gaps = read_column(in, count);
  const auto kinds = read_column(in, count);
  if (!in.ok()) return {};
  placements.resize(count);
  uint64_t next = 0;
  uint32_t blocks = 0, colors = 0;
  for (uint32_t i = 0; i < count; ++i) {
    const uint64_t patch = next + gaps[i];
    if (patch > UINT32_MAX || kinds[i] > 2)
      return "placement " + std::to_string(i) + ": its patch does not fit in 32 bits, or its kind is unknown";
    placements[i].patch = static_cast<uint32_t>(patch);
    placements[i].kind = kKinds[kinds[i]];
    blocks += placements[i].kind == PlacementKind::block;
    colors += placements[i].kind == PlacementKind::color;
    next = patch + 1;
  }
  if (std::string error = read_blocks(in, blocks, placements); !error.empty() || !in.ok()) return error;
  return read_colors(in, colors, placements);
}

}  // namespace tessera::geometry_compression
