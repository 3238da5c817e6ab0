#include "atlas/coherent/layout.h"

#include <algorithm>

#include "absl/functional/function_ref.h"
#include "atlas/coherent/rectangles.h"
#include "atlas/coherent/slabs.h"
#include "atlas/coherent/spacing.h"

namespace tessera::atlas::coherent {
namespace {

constexpr uint32_t kMaxSide = 8192;      // texels
constexpr double kFirstTarget = 0.88;    // share of the atlas
constexpr int kPatienceFrames = 15;      // until it grows by a hundredth: what grows with it is little
constexpr uint64_t kStages = 16;         // of re-placing the atlas: a frame moves at most this part of it
constexpr uint64_t kGentleStages = 256;  // likewise, while all have a place
constexpr float kFullest = 0.75f;        // slabs with a larger share in use are not worth emptying
constexpr int64_t kGrowthStages = 32;    // as kStages, for growth
constexpr size_t kGrowthTries = 16;      // that find no room, a frame
constexpr float kUrgent = 3;             // growth by so much deserves that others move
constexpr float kAhead = 0.8f;           // of bias: who grows is likely to come closer still
constexpr int kFirstTries = 16;          // to find a place for all in the first frame
constexpr int kPauseFrames = 15;         // after a stage that served no need
constexpr int kMostPauseFrames = 240;    // doubled for each stage in a row that helped nobody
constexpr int kMostShortFrames = 60;     // then the target is too large
constexpr size_t kFewHalved = 64;        // one in so many does not tell that the target is too large
constexpr int kHalvings = 3;             // of a rectangle's area, where there is no room for all of it

Status check(const LayoutSettings& s) {
  for (const uint32_t side : {s.width, s.height}) {
    if (side < 2 || side > kMaxSide || side % 2 != 0)
      return absl::InvalidArgumentError(absl::StrFormat(
          "atlas layout: size %dx%d, both sides must be even, 2 to %d", s.width, s.height, kMaxSide));
  }
  if (!(s.high_water > 0 && s.high_water <= 1))
    return absl::InvalidArgumentError("atlas layout: high_water must be a share in (0, 1]");
  return absl::OkStatus();
}

RectangleSize size_of(const Placement& p) {
  const auto w = static_cast<uint16_t>(p.color_width()), h = static_cast<uint16_t>(p.color_height());
  return p.transposed ? RectangleSize{h, w} : RectangleSize{w, h};
}

void set_size(Placement& p, const RectangleSize& size) {
  const uvec2 sides = sides_of(size, p.masked);
  p.kind = PlacementKind::block;
  p.width = static_cast<uint16_t>(sides.x);
  p.height = static_cast<uint16_t>(sides.y);
  p.transposed = size.u < size.v;  // the long side is the width
}

// Along the side that lacks most, squared, as an area's.
float growth_of(const RectangleSize& held, const RectangleSize& wished) {
  const float side = std::max(static_cast<float>(wished.u) / held.u, static_cast<float>(wished.v) / held.v);
  return side * side;
}

}  // namespace

struct Layout::Impl {
  Impl(const scene::Scene& s, const LayoutSettings& l)
      : scene(s),
        settings(l),
        traits(s),
        slabs(l.width, l.height),
        target(l.width * double(l.height), kFirstTarget, kPatienceFrames),
        most(most_sides(l.width, l.height)) {}

  struct Growth {
    float by;        // growth_of()
    uint32_t index;  // of `now`
    Spacing spacing;
  };

  LayoutDelta update(const LayoutInput& input);
  void place(const LayoutInput& input);
  void fit_first_frame(const LayoutInput& input);
  void follow_bias(const scene::VisiblePatches& visible);
  void choose(const LayoutInput& input);
  void choose_one(scene::PatchId patch, const Wanted& wanted, const Placement* was,
                  absl::FunctionRef<Spacing()> spacing_now);
  void allocate();
  void grow();
  RectangleSize size_ahead(const Growth& growth, float ahead) const;
  bool take_larger_place(const Growth& growth);
  bool take_place(Placement& p, bool may_draw = true);
  bool take_smaller_place(Placement& p);
  void clear_gently();
  void plan_stage();
  void count(const LayoutDelta& delta);
  void plan_next_frame();
  uint64_t texels() const { return uint64_t{settings.width} * settings.height; }
  void free(const Placement& p) {
    if (p.kind == PlacementKind::block) slabs.free({p.x, p.y}, p.width, p.height);
  }

  const scene::Scene& scene;
  LayoutSettings settings;
  PatchTraitTable traits;
  Slabs slabs;
  AdaptiveTarget target;
  float needed_bias = 0;  // of the last frame
  BiasFollower bias;
  LayoutStats stats;
  MostSides most;
  bool memory_short = false;  // after the last frame
  uvec2 waiting{0};           // sides of the first whose growth is urgent and found no room; 0: none
  bool cleared = false;       // for it
  int frames_to_gentle_stage = 0;
  int frames_short = 0;  // in a row, while some should grow
  int frames_to_next_stage = 0, starved_pause = 1, frames_since_shrink = kPauseFrames;
  size_t starved_before = 0;  // the last stage

  std::vector<Placement> now, before;   // sorted by patch
  std::vector<scene::PatchId> starved;  // without a rectangle for want of memory; sorted
  // Of this frame; kept to keep their memory.
  std::vector<Wanted> wanted;              // a visible patch
  std::vector<uint32_t> moving, entering;  // indices of `now` that need a rectangle; moving ones had one
  std::vector<Growth> growing;             // who should be larger; keeps what it has until then
  std::vector<uvec2> no_room;              // sides for which none was found
};

LayoutDelta Layout::Impl::update(const LayoutInput& input) {
  place(input);
  if (before.empty()) fit_first_frame(input);
  slabs.reopen();
  const LayoutDelta delta = difference(before, now);
  count(delta);
  plan_next_frame();
  return delta;
}

void Layout::Impl::place(const LayoutInput& input) {
  follow_bias(input.visible);
  choose(input);
  if (cleared) grow();  // else those that made room for it would come back
  allocate();
  if (!cleared) grow();
}

// Nothing is shown yet that could move: until all have a place, starts anew with a smaller target. Few large
// rectangles leave more room unused than the target allows for.
void Layout::Impl::fit_first_frame(const LayoutInput& input) {
  const float max_bias = settings.levels.max_bias;
  const auto all_fit = [this] { return starved.empty() && stats.blocks_halved == 0; };
  for (int tries = 0; !all_fit() && stats.bias < max_bias && tries < kFirstTries; ++tries) {
    target.on_out_of_memory();
    slabs = Slabs(settings.width, settings.height);
    bias = {};
    now.clear();
    place(input);
  }
}

void Layout::Impl::follow_bias(const scene::VisiblePatches& visible) {
  wanted.clear();
  for (const scene::VisiblePatch& v : visible) {
    const PatchTraits t = traits[v.patch];
    wanted.push_back({rectangle_need(v.footprint, t.triangle_count), t.masked});
  }
  needed_bias = select_bias(wanted, target.texels(), settings.levels, most, needed_bias);
  stats.bias = bias.follow(needed_bias);
}

// Merges the visible patches with those of the last frame.
void Layout::Impl::choose(const LayoutInput& input) {
  std::swap(now, before);
  for (auto* list : {&moving, &entering}) list->clear();
  growing.clear();
  now.clear();
  auto old = before.begin();
  uint32_t instance = 0;
  for (size_t i = 0; i < input.visible.size(); ++i) {
    const scene::PatchId patch = input.visible[i].patch;
    for (; old != before.end() && old->patch < patch; ++old) free(*old);
    while (instance + 1 < scene.instances.size() && scene.instances[instance + 1].first_patch <= patch)
      ++instance;
    const scene::Instance& owner = scene.instances[instance];
    const scene::Geometry& geometry = scene.geometries[owner.geometry];
    const auto spacing = [&] {
      return spacing_for(geometry, geometry.patches[patch - owner.first_patch], input.transforms[instance],
                         input.eye);
    };
    const bool known = old != before.end() && old->patch == patch;
    choose_one(patch, wanted[i], known ? &*old : nullptr, spacing);
    if (known) ++old;
  }
  for (; old != before.end(); ++old) free(*old);
}

// A part of the atlas a frame, the smallest for their wish first. What finds no room keeps what it has. While
// memory is short, only in gaps: the last room for slabs is for those that have nothing.
void Layout::Impl::grow() {
  waiting = {};
  no_room.clear();
  std::ranges::sort(growing, [](const Growth& a, const Growth& b) {
    return a.by != b.by ? a.by > b.by : a.index < b.index;
  });
  const int64_t budget = static_cast<int64_t>(texels()) / kGrowthStages;
  int64_t left = budget;
  for (const Growth& g : growing) {
    const uvec2 most_needed = sides_of(size_ahead(g, kAhead), now[g.index].masked);
    const bool first = left == budget;  // whatever its size
    if (!first && int64_t{most_needed.x} * most_needed.y > left) continue;
    if (take_larger_place(g)) left -= static_cast<int64_t>(now[g.index].texels());
    if (!memory_short && no_room.size() >= kGrowthTries) break;
  }
}

RectangleSize Layout::Impl::size_ahead(const Growth& g, float ahead) const {
  const Wanted& want = wanted[g.index];
  return select_size(want.need, want.masked, stats.bias - ahead, nullptr, settings.levels, most);
}

bool Layout::Impl::take_larger_place(const Growth& g) {
  Placement& p = now[g.index];
  Placement grown = p;
  grown.spacing = g.spacing;
  for (const float ahead : {kAhead, 0.0f}) {
    set_size(grown, size_ahead(g, ahead));
    // What stands holds rooms of its widths only; a new slab could hold what is narrower, too.
    const auto is_no_smaller = [&](const uvec2& s) {
      return (memory_short ? grown.width == s.x : grown.width >= s.x) && grown.height >= s.y;
    };
    if (std::ranges::any_of(no_room, is_no_smaller)) continue;
    if (take_place(grown, !memory_short)) {
      free(p);
      p = grown;
      return true;
    }
    no_room.emplace_back(grown.width, grown.height);
  }
  if (g.by >= kUrgent && waiting.x == 0 && !memory_short) waiting = {grown.width, grown.height};
  return false;
}

// `was`: or nullptr for a patch that was not visible.
void Layout::Impl::choose_one(scene::PatchId patch, const Wanted& want, const Placement* was,
                              absl::FunctionRef<Spacing()> spacing_now) {
  const bool had_place = was && was->kind == PlacementKind::block;
  const bool moves = had_place && slabs.closed({was->x, was->y});
  // A patch that is placed anew anyway takes the size that fits it best.
  const bool anchored =
      was && !moves && (had_place || !std::binary_search(starved.begin(), starved.end(), patch));
  const RectangleSize held = had_place ? size_of(*was) : RectangleSize{};
  const RectangleSize size =
      select_size(want.need, want.masked, stats.bias, anchored ? &held : nullptr, settings.levels, most);

  const auto index = static_cast<uint32_t>(now.size());
  Placement& p = now.emplace_back(Placement{.patch = patch, .masked = want.masked});
  if (size.single_color()) {
    if (had_place) free(*was);
    return;
  }
  const Spacing spacing = spacing_now();
  const uvec2 sides = sides_of(size, want.masked);
  const bool grows = had_place && sides.x * sides.y > was->texels();
  if (had_place && !moves && (size == held || grows)) {
    if (grows) growing.push_back({growth_of(held, size), index, spacing});
    p = *was;
    if (!still_good(was->spacing, spacing)) p.spacing = spacing;
    return;
  }
  set_size(p, size);
  p.spacing = spacing;
  if (had_place) free(*was);
  (had_place ? moving : entering).push_back(index);
}

bool Layout::Impl::take_place(Placement& p, bool may_draw) {
  const auto at = slabs.allocate(p.width, p.height, may_draw);
  if (!at) return false;
  p.x = static_cast<uint16_t>(at->x);
  p.y = static_cast<uint16_t>(at->y);
  return true;
}

// Fewer samples show less than they should, a single colour still less.
bool Layout::Impl::take_smaller_place(Placement& p) {
  const RectangleSize wished = size_of(p);
  RectangleNeed need{wished.u - 1.0f, wished.v - 1.0f};
  need.area = need.u * need.v;
  for (int halvings = 1; halvings <= kHalvings; ++halvings) {
    const auto bias_here = static_cast<float>(halvings);
    const RectangleSize size = select_size(need, p.masked, bias_here, nullptr, settings.levels, most);
    if (size.single_color()) return false;
    set_size(p, size);
    if (!take_place(p)) continue;
    ++stats.blocks_halved;
    return true;
  }
  return false;
}

void Layout::Impl::allocate() {
  // Wide ones first: what is left serves the narrow ones. Among equals in the order of patches: neighbours on
  // a surface look alike, which video coding likes.
  const auto wider = [this](uint32_t a, uint32_t b) {
    return now[a].width != now[b].width ? now[a].width > now[b].width : a < b;
  };
  starved.clear();
  stats.blocks_halved = 0;
  // Who had a place comes first: losing it would show more than not getting one.
  for (auto* list : {&moving, &entering}) {
    std::sort(list->begin(), list->end(), wider);
    for (const uint32_t index : *list) {
      Placement& p = now[index];
      if (take_place(p) || take_smaller_place(p)) continue;
      p = {.patch = p.patch, .masked = p.masked};
      starved.push_back(p.patch);
    }
  }
  std::sort(starved.begin(), starved.end());
}

void Layout::Impl::count(const LayoutDelta& delta) {
  const SlabStats memory = slabs.stats();
  stats.used_texels = memory.used_texels;
  stats.fragmented_texels = memory.slab_texels - memory.used_texels;
  const auto is_color = [](const Placement& p) { return p.kind == PlacementKind::color; };
  stats.colors = static_cast<uint32_t>(std::count_if(now.begin(), now.end(), is_color));
  stats.blocks = static_cast<uint32_t>(now.size()) - stats.colors;
  stats.colors_out_of_memory = static_cast<uint32_t>(starved.size());
  stats.changed = static_cast<uint32_t>(delta.changed.size());
  stats.removed = static_cast<uint32_t>(delta.removed.size());
}

// As few texels as make a slab empty, and then none until the mean is small.
void Layout::Impl::clear_gently() {
  if (--frames_to_gentle_stage > 0) return;
  frames_to_gentle_stage = kPauseFrames;
  bool closed = false;
  for (uint64_t stages = kGentleStages; stages >= kStages && !closed; stages /= 2) {
    closed = slabs.close_emptiest(texels() / stages, kFullest);
    if (closed) frames_to_gentle_stage = static_cast<int>(kGentleStages / stages);
  }
}

// Chooses the slabs that the next frame empties: little by little while all have a place, for what is moved
// costs bits. While patches starve, one stage follows the other as long as that helps them.
void Layout::Impl::plan_stage() {
  cleared = false;
  if (frames_to_next_stage > 0) --frames_to_next_stage;
  if (starved.empty()) starved_pause = 1;
  if (memory_short && starved.empty()) clear_gently();
  const bool waits = !memory_short && waiting.x > 0;
  if ((starved.empty() && !waits) || frames_to_next_stage > 0) return;
  const uint64_t most_moved = texels() / kStages;
  cleared = waits && slabs.close_for(waiting.x, waiting.y, most_moved);
  stats.reset = cleared || (!waits && slabs.close_emptiest(most_moved, kFullest));
  if (!stats.reset) return;
  ++stats.resets_total;
  const bool helps = starved.size() < starved_before;
  starved_before = starved.size();
  starved_pause = helps ? 1 : std::min(2 * starved_pause, kMostPauseFrames);
  frames_to_next_stage = starved.empty() ? kPauseFrames : starved_pause;
}

// Also calibrates the target (thesis 3.5).
void Layout::Impl::plan_next_frame() {
  const bool is_starved = !starved.empty() || stats.blocks_halved > 0;
  memory_short = is_starved || slabs.free_share() < 1 - settings.high_water;
  stats.reset = false;
  plan_stage();
  ++frames_since_shrink;
  frames_short = memory_short && !growing.empty() ? frames_short + 1 : 0;
  const bool too_much = !starved.empty() || stats.blocks_halved > now.size() / kFewHalved ||
                        frames_short % kMostShortFrames == kMostShortFrames - 1;
  if (too_much && frames_since_shrink >= kPauseFrames) {
    target.on_out_of_memory();
    frames_since_shrink = 0;
  } else if (!memory_short && stats.bias > settings.levels.min_bias) {
    target.on_quiet_frame();
  }
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

}  // namespace tessera::atlas::coherent
