#include "atlas/blocks/layout.h"

#include <algorithm>
#include <bit>

#include "atlas/blocks/staged_reset.h"

namespace tessera::atlas::blocks {
namespace {

constexpr uint32_t kMaxSide = 8192;  // texels
constexpr uint64_t kStages = 8;      // a stage moves at most this part of the atlas
constexpr int kPauseFrames = 15;     // between two resets; longer while resets do not help
constexpr int kLongestPauseFrames = 240;
constexpr int kMostHalvings = 3;
constexpr float kRelief = 0.9f;  // of the high-water mark: a reset may end early below it

Status check(const LayoutSettings& s) {
  if (s.superblock_log < kMinLog || s.superblock_log > 8) {
    return absl::InvalidArgumentError(
        absl::StrCat("atlas layout: superblock_log is ", s.superblock_log, ", must be 1 to 8"));
  }
  const uint32_t side = 1u << s.superblock_log;
  const auto fits = [&](uint32_t size) { return size >= side && size <= kMaxSide && size % side == 0; };
  if (!fits(s.width) || !fits(s.height)) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "atlas layout: size %dx%d, both sides must be multiples of the superblock's %d texels, up to %d",
        s.width, s.height, side, kMaxSide));
  }
  if (s.levels.max_log < kMinLog)
    return absl::InvalidArgumentError("atlas layout: levels.max_log must be at least 1");
  if (!(s.high_water > 0 && s.high_water <= 1)) {
    return absl::InvalidArgumentError("atlas layout: high_water must be a share in (0, 1]");
  }
  return absl::OkStatus();
}

uint64_t texel_count(Level level) {
  return uint64_t{1} << (level.log_w + level.log_h);
}

Level level_of(const Placement& p) {
  return {static_cast<uint8_t>(std::countr_zero(p.width)), static_cast<uint8_t>(std::countr_zero(p.height))};
}

// A block that is the smallest already stays.
void halve(Placement& p) {
  const uint64_t smallest = (p.masked ? 2u : 1u) << (2 * kMinLog);
  if (p.texels() > smallest) (p.width > p.height ? p.width : p.height) /= 2;
}

// A patch's place and whether it went without one for want of memory.
struct Places {
  std::vector<Placement> placements;  // sorted by patch
  std::vector<uint8_t> starved;       // a placement

  void clear() {
    placements.clear();
    starved.clear();
  }
};

}  // namespace

LayoutSettings settings_for(uint32_t width, uint32_t height) {
  constexpr uint64_t kLeastSuperblocks = 128;
  LayoutSettings settings{.kind = LayoutKind::blocks, .width = width, .height = height};
  while (settings.superblock_log > kMinLog &&
         ((uint64_t{width} * height) >> (2 * settings.superblock_log)) < kLeastSuperblocks) {
    --settings.superblock_log;
  }
  settings.levels.max_log = settings.superblock_log;
  return settings;
}

struct Layout::Impl {
  Impl(const scene::Scene& scene, const LayoutSettings& s, Strategy strategy)
      : settings(s),
        may_reset(strategy < Strategy::no_resets),
        traits(scene),
        superblocks((s.width >> s.superblock_log) * (s.height >> s.superblock_log)),
        allocator(s.superblock_log, superblocks, strategy),
        reset(superblocks),
        target(static_cast<double>(s.width) * s.height) {
    settings.levels.max_log = std::min(settings.levels.max_log, settings.superblock_log);
  }

  LayoutDelta update(const scene::VisiblePatches& visible);
  void follow_bias(const scene::VisiblePatches& visible);
  void choose_levels(const scene::VisiblePatches& visible);
  void choose_level(scene::PatchId patch, const BlockNeed& need, size_t old);
  void allocate();
  void allocate_moving();
  void plan_next_frame();
  void count(const LayoutDelta& delta);

  BlockAddress address(const Placement& placement) const;
  void place(Placement& placement, const BlockAddress& block) const;
  void free_block(const Placement& placement);
  bool must_move(const Placement& placement) const {
    return reset.active() && placement.kind == PlacementKind::block &&
           reset.empties(address(placement).superblock);
  }

  LayoutSettings settings;
  bool may_reset;
  PatchTraitTable traits;
  uint32_t superblocks;
  Allocator allocator;
  StagedReset reset;
  AdaptiveTarget target;
  BiasFollower bias;
  LayoutStats stats;

  bool memory_short = false;  // after the last frame: blocks may not grow
  int pause_frames = kPauseFrames, frames_since_reset = kPauseFrames;

  Places now, before;
  // Of this frame; kept to keep their memory.
  std::vector<BlockNeed> needs;    // a visible patch
  std::vector<float> ideal_areas;  // likewise
  std::vector<Request> frees, allocations;
  std::vector<BlockAddress> blocks;
  std::vector<uint32_t> moving, entering;  // indices of `now` that need a block; moving ones have one now
};

BlockAddress Layout::Impl::address(const Placement& p) const {
  const uint8_t log = settings.superblock_log;
  const uint32_t mask = (1u << log) - 1;
  const uint32_t superblock = (p.y >> log) * (settings.width >> log) + (p.x >> log);
  return {superblock, Allocator::index_in_superblock({p.x & mask, p.y & mask}, level_of(p), log)};
}

void Layout::Impl::place(Placement& placement, const BlockAddress& block) const {
  const uint8_t log = settings.superblock_log;
  const uint32_t superblocks_across = settings.width >> log;
  const uvec2 offset = Allocator::offset_in_superblock(block, level_of(placement), log);
  placement.x = static_cast<uint16_t>((block.superblock % superblocks_across << log) + offset.x);
  placement.y = static_cast<uint16_t>((block.superblock / superblocks_across << log) + offset.y);
}

void Layout::Impl::free_block(const Placement& placement) {
  if (placement.kind != PlacementKind::block) return;
  frees.push_back({.frees = true, .old_level = level_of(placement), .old_block = address(placement)});
}

LayoutDelta Layout::Impl::update(const scene::VisiblePatches& visible) {
  follow_bias(visible);
  if (reset.active()) {
    const uint64_t capacity = uint64_t{settings.width} * settings.height;
    reset.next_stage(allocator.used_texels(), allocator.fragmented_texels(), capacity / kStages);
  }
  choose_levels(visible);
  allocate();
  const LayoutDelta delta = difference(before.placements, now.placements);
  count(delta);
  plan_next_frame();
  return delta;
}

void Layout::Impl::follow_bias(const scene::VisiblePatches& visible) {
  ideal_areas.clear();
  needs.clear();
  for (const scene::VisiblePatch& v : visible) {
    needs.push_back(block_need(v.footprint, traits[v.patch]));
    ideal_areas.push_back(needs.back().area);
  }
  stats.bias = bias.follow(select_bias(ideal_areas, target.texels(), settings.levels));
}

// Merges the visible patches with those of the last frame.
void Layout::Impl::choose_levels(const scene::VisiblePatches& visible) {
  std::swap(now, before);
  now.clear();
  for (auto* list : {&frees, &allocations}) list->clear();
  for (auto* list : {&moving, &entering}) list->clear();
  size_t old = 0;
  const std::vector<Placement>& was = before.placements;
  for (size_t i = 0; i < visible.size(); ++i) {
    const scene::PatchId patch = visible[i].patch;
    for (; old < was.size() && was[old].patch < patch; ++old) free_block(was[old]);
    const bool known = old < was.size() && was[old].patch == patch;
    choose_level(patch, needs[i], known ? old : was.size());
    if (known) ++old;
  }
  for (; old < was.size(); ++old) free_block(was[old]);
}

// `old`: index in `before`, or its size for a patch that was not visible.
void Layout::Impl::choose_level(scene::PatchId patch, const BlockNeed& need, size_t old) {
  const bool known = old < before.placements.size();
  static constexpr Placement kAbsent;
  const Placement& was = known ? before.placements[old] : kAbsent;
  const bool had_block = known && was.kind == PlacementKind::block;
  const bool moves = had_block && must_move(was);
  // A patch that is placed anew anyway takes the level that fits it best.
  const bool anchored = known && !moves && !before.starved[old];
  const bool was_color = was.kind == PlacementKind::color;
  const LevelWish previous{was_color, was_color ? Level{} : level_of(was), was.transposed};
  const bool masked = traits[patch].masked;
  const LevelWish wish =
      select_level(need, masked, stats.bias, anchored ? &previous : nullptr, settings.levels);

  const auto index = static_cast<uint32_t>(now.placements.size());
  Placement& placement = now.placements.emplace_back(Placement{.patch = patch, .masked = masked});
  now.starved.push_back(0);
  const bool waits =
      had_block && !moves && memory_short && !wish.single_color && texel_count(wish.level) > was.texels();
  if (waits) {
    placement = was;
  } else if (wish.single_color) {
    if (had_block) free_block(was);
  } else {
    placement.kind = PlacementKind::block;
    placement.width = static_cast<uint16_t>(1u << wish.level.log_w);
    placement.height = static_cast<uint16_t>(1u << wish.level.log_h);
    placement.transposed = wish.transposed;
    if (had_block && !moves && wish.level == level_of(was)) {
      placement.x = was.x;
      placement.y = was.y;
    } else {
      if (had_block) free_block(was);
      (had_block ? moving : entering).push_back(index);
    }
  }
}

void Layout::Impl::allocate() {
  blocks.resize(frees.size());
  allocator.update(frees, blocks);
  allocator.recycle();

  // Who had a block comes first: losing it would show more than not getting one.
  moving.insert(moving.end(), entering.begin(), entering.end());
  allocate_moving();
  stats.blocks_halved = 0;
  // Fewer samples show less than a single colour does.
  for (int halvings = 0; halvings < kMostHalvings && !moving.empty(); ++halvings) {
    for (const uint32_t index : moving) halve(now.placements[index]);
    stats.blocks_halved += static_cast<uint32_t>(moving.size());
    allocate_moving();
    stats.blocks_halved -= static_cast<uint32_t>(moving.size());
  }
  for (const uint32_t index : moving) {
    Placement& placement = now.placements[index];
    placement = {.patch = placement.patch, .masked = placement.masked};
    now.starved[index] = 1;
  }
}

// Leaves in `moving` those that find no memory.
void Layout::Impl::allocate_moving() {
  allocations.clear();
  for (const uint32_t index : moving) {
    allocations.push_back({.allocates = true, .level = level_of(now.placements[index])});
  }
  blocks.resize(allocations.size());
  allocator.update(allocations, blocks);
  size_t left = 0;
  for (size_t i = 0; i < blocks.size(); ++i) {
    if (blocks[i] != Allocator::kNoBlock) {
      place(now.placements[moving[i]], blocks[i]);
    } else {
      moving[left++] = moving[i];
    }
  }
  moving.resize(left);
}

void Layout::Impl::count(const LayoutDelta& delta) {
  const AllocatorStats memory = allocator.stats();
  stats.used_texels = memory.used_texels;
  stats.fragmented_texels = memory.stack_texels + memory.carry_texels + memory.inaccessible_texels;
  const auto is_color = [](const Placement& p) { return p.kind == PlacementKind::color; };
  stats.colors = static_cast<uint32_t>(std::count_if(now.placements.begin(), now.placements.end(), is_color));
  stats.blocks = static_cast<uint32_t>(now.placements.size()) - stats.colors;
  stats.colors_out_of_memory = static_cast<uint32_t>(std::count(now.starved.begin(), now.starved.end(), 1));
  stats.changed = static_cast<uint32_t>(delta.changed.size());
  stats.removed = static_cast<uint32_t>(delta.removed.size());
  stats.reset = reset.active();
}

// Starts and ends resets, and calibrates the target (thesis 3.5).
void Layout::Impl::plan_next_frame() {
  const AllocatorStats memory = allocator.stats();
  const float share_in_use =
      1 - static_cast<float>(memory.free_superblocks) / static_cast<float>(superblocks);
  const bool starved = stats.colors_out_of_memory > 0 || stats.blocks_halved > 0;
  const bool above_mark = share_in_use > settings.high_water;
  const bool fragmented =
      memory.stack_texels + memory.inaccessible_texels >= memory.capacity_texels / superblocks;
  const uint64_t spare_texels = memory.carry_texels + memory.free_texels;
  memory_short = starved || static_cast<float>(spare_texels) <
                                (1 - settings.high_water) * static_cast<float>(memory.capacity_texels);
  ++frames_since_reset;
  if (reset.active()) {
    if (!starved && share_in_use < kRelief * settings.high_water) reset.stop();
    if (!starved) pause_frames = kPauseFrames;
    frames_since_reset = 0;
  } else if (may_reset && (starved || (above_mark && fragmented)) && frames_since_reset >= pause_frames) {
    reset.start(allocator.used_texels());
    if (starved) target.on_out_of_memory();  // fragmentation alone is cured by the reset
    ++stats.resets_total;
    pause_frames = std::min(2 * pause_frames, kLongestPauseFrames);
  } else if (!memory_short && stats.bias > settings.levels.min_bias) {
    target.on_quiet_frame();
  }
}

StatusOr<std::unique_ptr<Layout>> Layout::create(const scene::Scene& scene, const LayoutSettings& settings,
                                                 Strategy strategy) {
  TESSERA_RETURN_IF_ERROR(check(settings));
  return std::unique_ptr<Layout>(new Layout(std::make_unique<Impl>(scene, settings, strategy)));
}

Layout::Layout(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Layout::~Layout() = default;
LayoutDelta Layout::update(const LayoutInput& input) {
  return impl_->update(input.visible);
}
std::span<const Placement> Layout::placements() const {
  return impl_->now.placements;
}
const LayoutStats& Layout::stats() const {
  return impl_->stats;
}
AllocatorStats Layout::memory() const {
  return impl_->allocator.stats();
}

}  // namespace tessera::atlas::blocks
