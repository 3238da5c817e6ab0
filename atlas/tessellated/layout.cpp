#include "atlas/tessellated/layout.h"

#include <algorithm>

#include "atlas/addressing/addressing.h"
#include "atlas/tessellated/packing.h"
#include "atlas/tessellated/triangles.h"

namespace tessera::atlas::tessellated {
namespace {

constexpr uint32_t kMaxSide = 8192;     // texels
constexpr double kTargetShare = 0.97;   // of the atlas: rows end with a gap
constexpr int kTries = 6;               // to find a bias at which all fits
constexpr float kBiasStep = 1.0f / 32;  // between the first two; doubles from try to try

Status check(const LayoutSettings& s) {
  for (const uint32_t side : {s.width, s.height}) {
    if (side < 8 || side > kMaxSide || side % 2 != 0)
      return absl::InvalidArgumentError(absl::StrFormat(
          "atlas layout: size %dx%d, both sides must be even, 8 to %d", s.width, s.height, kMaxSide));
  }
  if (!(s.slantedness >= 1))
    return absl::InvalidArgumentError(
        absl::StrFormat("atlas layout: slantedness %g, it must be at least 1", s.slantedness));
  return absl::OkStatus();
}

Placement placement_of(const Placement& blank, const TriangleNeed& need, const Shape& shape) {
  Placement p = blank;
  p.kind = shape.kind;
  if (shape.kind == PlacementKind::l) {
    p.l.level = shape.level;
    p.l.splits = shape.splits;
  } else if (shape.kind == PlacementKind::halves) {
    p.halves.apex = need.apex;
    p.halves.foot = static_cast<uint8_t>(std::clamp(static_cast<int>(64 * need.foot), 0, 63));
    p.halves.across = shape.across;
    for (int half = 0; half < 2; ++half) p.halves.half[half].along = shape.along[half];
  }
  return p;
}

}  // namespace

struct Layout::Impl {
  Impl(const scene::Scene& s, const LayoutSettings& l)
      : scene(s), settings(l), traits(s), limits(limits_for(l.width, l.height)) {}

  LayoutDelta update(const LayoutInput& input);
  void look(const LayoutInput& input);
  void place_all();
  uint32_t place(float bias);
  void fill_bins(float bias);
  uint32_t place_ls(Rows& rows, uint32_t level);
  uint32_t place_halves(Rows& rows, uint32_t width);
  void fall_back(uint32_t index);
  void count(const LayoutDelta& delta);

  const scene::Scene& scene;
  LayoutSettings settings;
  PatchTraitTable traits;
  ShapeLimits limits;
  LayoutStats stats;

  std::vector<Placement> now, before;  // sorted by patch and part
  // Of this frame; kept to keep their memory.
  std::vector<TriangleNeed> needs;  // as `now`
  std::vector<Placement> blanks;    // as `now`: what does not depend on the bias
  // Indices of `now`, by bin; masked Ls apart, since they come first.
  std::array<std::vector<uint32_t>, addressing::kMaxTessellationLevel + 1> masked_ls, ls;
  std::array<std::vector<uint32_t>, addressing::kMaxHalfWidth + 1> halves;
};

LayoutDelta Layout::Impl::update(const LayoutInput& input) {
  std::swap(now, before);
  look(input);
  place_all();
  const LayoutDelta delta = difference(before, now);
  count(delta);
  return delta;
}

void Layout::Impl::look(const LayoutInput& input) {
  needs.clear();
  blanks.clear();
  std::array<SeenTriangle, 3> seen;
  uint32_t instance = 0;
  for (const scene::VisiblePatch& v : input.visible) {
    while (instance + 1 < scene.instances.size() && scene.instances[instance + 1].first_patch <= v.patch)
      ++instance;
    const scene::Instance& owner = scene.instances[instance];
    const scene::Geometry& geometry = scene.geometries[owner.geometry];
    const uint32_t triangles = see(geometry, geometry.patches[v.patch - owner.first_patch], v.footprint,
                                   input.transforms[instance], input.eye, seen);
    const bool masked = traits[v.patch].masked;
    for (uint32_t t = 0; t < triangles; ++t) {
      seen[t].need.masked = masked;
      needs.push_back(seen[t].need);
      Placement& blank =
          blanks.emplace_back(Placement{.patch = v.patch, .part = part_of(t), .masked = masked});
      std::copy(seen[t].spacing.begin(), seen[t].spacing.end(), blank.spacing.begin());
    }
  }
}

void Layout::Impl::place_all() {
  const double target = kTargetShare * settings.width * settings.height;
  stats.bias = select_bias(needs, target, settings, limits);
  float step = kBiasStep;
  for (int tries = 1;; ++tries, step *= 2) {
    stats.colors_out_of_memory = place(stats.bias);
    const bool helps = stats.bias < settings.levels.max_bias;
    if (stats.colors_out_of_memory == 0 || tries == kTries || !helps) return;
    stats.bias = std::min(stats.bias + step, settings.levels.max_bias);
  }
}

// How many found no room.
uint32_t Layout::Impl::place(float bias) {
  fill_bins(bias);
  Rows rows(settings.width, settings.height);
  uint32_t without = 0;
  const int highest = std::max(addressing::l_pair_pitch(addressing::kMaxTessellationLevel).y,
                               half_row_height(ivec2(addressing::kMaxHalfWidth)));
  for (int height = highest; height >= 2; height -= 2) {
    for (int level = addressing::kMaxTessellationLevel; level >= 1; --level)
      if (addressing::l_pair_pitch(level).y == height)
        without += place_ls(rows, static_cast<uint32_t>(level));
    for (int width = addressing::kMaxHalfWidth; width >= 1; --width)
      if (half_row_height(ivec2(width)) == height)
        without += place_halves(rows, static_cast<uint32_t>(width));
  }
  return without;
}

// In a bin in the order of patches: neighbours on a surface look alike, which coding likes.
void Layout::Impl::fill_bins(float bias) {
  for (auto* bins : {&masked_ls, &ls})
    for (auto& bin : *bins) bin.clear();
  for (auto& bin : halves) bin.clear();
  now.clear();
  for (uint32_t i = 0; i < needs.size(); ++i) {
    const Shape shape = select_shape(needs[i], bias, settings, limits);
    now.push_back(placement_of(blanks[i], needs[i], shape));
    if (shape.kind == PlacementKind::l) {
      (needs[i].masked ? masked_ls : ls)[shape.level].push_back(i);
    } else if (shape.kind == PlacementKind::halves) {
      for (const uint16_t along : shape.along) {
        auto& bin = halves[addressing::half_staircase(shape.across, along).x];
        // A triangle whose halves are equally wide is in the bin once, for both.
        if (bin.empty() || bin.back() != i) bin.push_back(i);
      }
    } else {
      now.back().spacing = {};
    }
  }
}

uint32_t Layout::Impl::place_ls(Rows& rows, uint32_t level) {
  uint32_t without = 0;
  LBin bin(rows, level);
  for (const auto* indices : {&masked_ls[level], &ls[level]}) {
    for (const uint32_t index : *indices) {
      if (bin.place(now[index])) continue;
      fall_back(index);
      ++without;
    }
  }
  return without;
}

// Halves of one triangle may be of different widths; what one of them has taken is lost if the other finds no
// room.
uint32_t Layout::Impl::place_halves(Rows& rows, uint32_t width) {
  uint32_t without = 0;
  HalfBin bin(rows);
  for (const uint32_t index : halves[width]) {
    Placement& p = now[index];
    if (p.kind == PlacementKind::color) continue;
    for (HalfPlace& half : p.halves.half) {
      const ivec2 size = addressing::half_staircase(p.halves.across, half.along);
      if (static_cast<uint32_t>(size.x) != width || bin.place(size, half)) continue;
      fall_back(index);
      ++without;
      break;
    }
  }
  return without;
}

void Layout::Impl::fall_back(uint32_t index) {
  now[index] = blanks[index];
  now[index].spacing = {};
}

void Layout::Impl::count(const LayoutDelta& delta) {
  stats.used_texels = 0;
  stats.colors = stats.halves = 0;
  for (const Placement& p : now) {
    stats.used_texels += p.texels();
    stats.colors += p.kind == PlacementKind::color;
    stats.halves += p.kind == PlacementKind::halves;
  }
  stats.blocks = static_cast<uint32_t>(now.size()) - stats.colors;
  stats.changed = static_cast<uint32_t>(delta.changed.size());
  stats.removed = static_cast<uint32_t>(delta.removed.size());
}

StatusOr<std::unique_ptr<Layout>> Layout::create(const scene::Scene& scene, const LayoutSettings& settings) {
  TESSERA_RETURN_IF_ERROR(check(settings));
  return std::unique_ptr<Layout>(new Layout(std::make_unique<Impl>(scene, settings)));
}

Layout::Layout(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Layout::~Layout() = default;
LayoutDelta Layout::update(const LayoutInput& input) {
  return impl_->update(input);
}
std::span<const Placement> Layout::placements() const {
  return impl_->now;
}
const LayoutStats& Layout::stats() const {
  return impl_->stats;
}

}  // namespace tessera::atlas::tessellated
