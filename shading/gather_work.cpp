#include "shading/gather_work.h"

#include "atlas/addressing/addressing.h"
#include "shading/tessellator.h"

namespace tessera::shading {
namespace {

struct Item {
  BlockRecord record;
  uint32_t material;
  GatherPath path;  // not automatic
};

using atlas::Placement;
using atlas::PlacementKind;
namespace addressing = atlas::addressing;

uint32_t packed(uint32_t low, uint32_t high) {
  return low | high << 16;
}

uint32_t spacing_of(const Placement& p) {
  uint32_t codes = 0;
  for (size_t i = 0; i < p.spacing.size(); ++i)
    codes |= uint32_t{static_cast<uint8_t>(p.spacing[i])} << (8 * i);
  return codes;
}

addressing::ivec2 stairs_of(const BlockRecord& r) {
  return addressing::half_staircase(static_cast<int>(r.size & 0xff), static_cast<int>(r.size >> 8 & 0x7ff));
}

uint64_t item_samples(const BlockRecord& r) {
  if (r.shape & kBlockL)
    return static_cast<uint64_t>(addressing::l_samples(static_cast<int>(r.size & 0x7f))) *
           (r.shape & kBlockMasked ? 2 : 1);
  if (r.shape & kBlockHalf) return static_cast<uint64_t>(addressing::staircase_samples(stairs_of(r)));
  return uint64_t{r.size & 0xffff} * (r.size >> 16);
}

GatherShape shape_of(const BlockRecord& r) {
  if (r.shape & kBlockL) return GatherShape::l;
  return r.shape & kBlockHalf ? GatherShape::half : GatherShape::block;
}

// Of a record of the tessellation path.
uint32_t item_points(const BlockRecord& r) {
  if (r.shape & kBlockL)
    return static_cast<uint32_t>(addressing::tessellation_vertices(static_cast<int>(r.size & 0x7f)));
  const int samples = addressing::staircase_samples(stairs_of(r));
  return std::min(static_cast<uint32_t>(addressing::oversampling_part(samples)),
                  static_cast<uint32_t>(samples) - r.first_sample);
}

// Beyond the staircase's third side. Every row begins inside.
uint64_t samples_outside(const addressing::ivec2& stairs) {
  uint64_t outside = 0;
  for (int y = 0; y <= stairs.y; ++y)
    outside += static_cast<uint64_t>(addressing::staircase_row(y, stairs) -
                                     (1 + stairs.x * (stairs.y - y) / stairs.y));
  return outside;
}

Status check_rectangle(uint32_t x, uint32_t y, uint32_t width, uint32_t height, const GatherLimits& limits) {
  if (width == 0 || height == 0 || x + width > limits.width || y + height > limits.height)
    return absl::InvalidArgumentError(
        absl::StrFormat("gather: block of %ux%u texels at (%u, %u) is empty or leaves the %ux%u atlas", width,
                        height, x, y, limits.width, limits.height));
  return absl::OkStatus();
}

Status check_part(const Placement& p, uint32_t triangles) {
  const bool needs_triangle = p.kind == PlacementKind::l || p.kind == PlacementKind::halves;
  if (p.part > triangles || (needs_triangle && p.part == atlas::kWholePatch))
    return absl::InvalidArgumentError(absl::StrFormat(
        "gather: placement of part %d of patch %u, which has %u triangles", int{p.part}, p.patch, triangles));
  return absl::OkStatus();
}

// Placements come sorted by patch for the most part: the last instance is the likeliest.
class InstanceFinder {
 public:
  explicit InstanceFinder(const scene::Scene& scene) : scene_(scene) {}
  uint32_t find(scene::PatchId patch) {
    const uint32_t first = scene_.instances[last_].first_patch;
    const uint32_t count = static_cast<uint32_t>(geometry(last_).patches.size());
    if (patch < first || patch - first >= count) last_ = scene_.instance_of(patch);
    return last_;
  }
  const scene::Geometry& geometry(uint32_t instance) const {
    return scene_.geometries[scene_.instances[instance].geometry];
  }

 private:
  const scene::Scene& scene_;
  uint32_t last_ = 0;
};

// Stable counting sort by material, so that work on neighbouring patches stays together.
std::vector<uint32_t> order_by_material(std::span<const Item> items, size_t materials) {
  std::vector<uint32_t> ends(materials + 1);
  for (const Item& item : items) ++ends[item.material + 1];
  for (size_t m = 0; m < materials; ++m) ends[m + 1] += ends[m];
  std::vector<uint32_t> order(items.size());
  for (uint32_t i = 0; i < items.size(); ++i) order[ends[items[i].material]++] = i;
  return order;
}

// Appends compute blocks and the start of every chunk; each material's samples fill whole chunks.
void add_compute(GatherWork& work, std::span<const Item> items, std::span<const uint32_t> order) {
  uint64_t next = 0;  // sample
  uint32_t material = ~0u;
  for (uint32_t i : order) {
    if (items[i].path != GatherPath::compute) continue;
    if (items[i].material != material) {
      next = work.starts.size() * kChunkSamples;
      const auto chunk = static_cast<uint32_t>(work.starts.size());
      work.compute_batches.push_back({items[i].material, chunk, chunk});
    }
    material = items[i].material;
    BlockRecord block = items[i].record;
    block.first_sample = static_cast<uint32_t>(next);
    const auto index = static_cast<uint32_t>(work.blocks.size());
    const uint64_t samples = item_samples(block);
    next += samples;
    // Chunks whose first sample lies in this block.
    while (work.starts.size() * kChunkSamples < next) work.starts.push_back(index);
    work.compute_batches.back().end_chunk = static_cast<uint32_t>(work.starts.size());
    work.blocks.push_back(block);
    if (!(block.shape & kBlockColor)) ++work.compute_blocks;
  }
  work.blocks.push_back({.first_sample = ~0u});
}

void add_raster(GatherWork& work, std::span<const Item> items, std::span<const uint32_t> order) {
  uint32_t material = ~0u;
  for (uint32_t i : order) {
    if (items[i].path != GatherPath::raster) continue;
    if (items[i].material != material)
      work.raster_batches.push_back({items[i].material, static_cast<uint32_t>(work.blocks.size()), 0});
    material = items[i].material;
    ++work.raster_batches.back().block_count;
    ++work.raster_blocks;
    work.blocks.push_back(items[i].record);
  }
}

void add_tessellation(GatherWork& work, std::span<const Item> items, std::span<const uint32_t> order) {
  uint32_t material = ~0u, points = 0;  // of the last batch
  for (uint32_t i : order) {
    if (items[i].path != GatherPath::tessellation) continue;
    const uint32_t more = item_points(items[i].record);
    if (items[i].material != material || points + more > kMaxPointsADraw) {
      work.tessellation_batches.push_back({items[i].material, static_cast<uint32_t>(work.blocks.size()), 0});
      points = 0;
    }
    material = items[i].material;
    points += more;
    ++work.tessellation_batches.back().block_count;
    ++work.tessellated_blocks;
    work.blocks.push_back(items[i].record);
  }
}

// The records of the placements, in their order.
class Items {
 public:
  Items(const GatherLimits& limits, GatherWork& work) : limits_(limits), work_(work) {}

  // `first`: what all records of `p` have in common, with its triangle count.
  Status add(const Placement& p, BlockRecord first, uint32_t material) {
    material_ = material;
    first.spacing = spacing_of(p);
    first.shape |= p.masked && p.kind != PlacementKind::color ? kBlockMasked : 0;
    switch (p.kind) {
      case PlacementKind::color:
        first.place = work_.colors++;
        first.size = packed(1, 1);
        first.shape |= kBlockColor;
        items_.push_back({first, material, GatherPath::compute});
        ++work_.samples;
        return absl::OkStatus();
      case PlacementKind::block:
        first.size = packed(p.width, p.height);
        first.shape |= p.transposed ? kBlockTransposed : 0;
        return add_one(first, p.x, p.y, p.width, p.height);
      case PlacementKind::l:
        return add_ls(p, first);
      case PlacementKind::halves:
        return add_halves(p, first);
    }
    return absl::InvalidArgumentError("gather: unknown kind of placement");
  }
  std::vector<Item>& items() { return items_; }

 private:
  Status add_ls(const Placement& p, BlockRecord record) {
    const int level = p.l.level, splits = p.l.splits;
    if (level < 1 || level > addressing::kMaxTessellationLevel || splits < 1 ||
        splits > addressing::kMaxSplits ||
        static_cast<uint32_t>(p.x + addressing::l_pair_pitch(level).x) > limits_.width)
      return absl::InvalidArgumentError(
          absl::StrFormat("gather: L of level %d, split in %d, at (%u, %u) of the %ux%u atlas", level, splits,
                          p.x, p.y, limits_.width, limits_.height));
    const addressing::ivec2 size = addressing::l_pair_size(level);
    record.shape |= kBlockL;
    const uint32_t shape = record.shape;
    for (int i = 0; i < splits * splits; ++i) {
      const int half = p.masked ? 2 * i : i + p.l.turned;  // of a pair
      const addressing::ivec2 at =
          addressing::l_pair_place(half / 2, {p.x, p.y}, p.l.next_y, level, static_cast<int>(limits_.width));
      record.size = static_cast<uint32_t>(level | splits << 7 | i << 12);
      record.shape = shape | (half % 2 == 1 ? kBlockTurned : 0);
      TESSERA_RETURN_IF_ERROR(add_one(record, static_cast<uint32_t>(at.x), static_cast<uint32_t>(at.y),
                                      static_cast<uint32_t>(size.x), static_cast<uint32_t>(size.y)));
    }
    return absl::OkStatus();
  }

  Status add_halves(const Placement& p, BlockRecord record) {
    const uint32_t shape = record.shape | kBlockHalf;
    const atlas::HalvesPlace& h = p.halves;
    for (uint32_t half = 0; half < 2; ++half) {
      const atlas::HalfPlace& place = h.half[half];
      if (h.apex > 2 || h.foot > 63 || h.across < 1 || h.across > addressing::kMaxHalfWidth ||
          place.along < 1 || place.along > addressing::kMaxHalfLength)
        return absl::InvalidArgumentError(absl::StrFormat("gather: half of %dx%d intervals, apex %d, foot %d",
                                                          int{h.across}, int{place.along}, int{h.apex},
                                                          int{h.foot}));
      const addressing::ivec2 stairs = addressing::half_staircase(h.across, place.along);
      record.size = h.across | uint32_t{place.along} << 8 | uint32_t{h.foot} << 19 | uint32_t{h.apex} << 25 |
                    half << 27;
      record.shape = shape | (place.turned ? kBlockTurned : 0);
      TESSERA_RETURN_IF_ERROR(add_one(record, place.x, place.y, static_cast<uint32_t>(stairs.y + 1),
                                      static_cast<uint32_t>(stairs.x + 1)));
      work_.half_samples += item_samples(record);
      work_.half_samples_outside += samples_outside(stairs);
    }
    return absl::OkStatus();
  }

  Status add_one(BlockRecord record, uint32_t x, uint32_t y, uint32_t width, uint32_t height) {
    TESSERA_RETURN_IF_ERROR(check_rectangle(x, y, width, height, limits_));
    record.place = packed(x, y);
    work_.samples += item_samples(record);
    const GatherPath path = limits_.choice.of(shape_of(record), item_samples(record));
    if (path == GatherPath::tessellation)
      add_triangles(record);
    else
      items_.push_back({record, material_, path});
    return absl::OkStatus();
  }

  // What the tessellator takes for a record: see GatherWork::blocks.
  void add_triangles(BlockRecord record) {
    const auto samples = static_cast<uint32_t>(item_samples(record));
    const auto add = [&] { items_.push_back({record, material_, GatherPath::tessellation}); };
    if (record.shape & kBlockL) {
      add();
      record.shape |= kBlockTurned;
      if (record.shape & kBlockMasked) add();
      return;
    }
    for (; record.first_sample < samples; record.first_sample += item_points(record)) add();
  }

  const GatherLimits& limits_;
  GatherWork& work_;
  uint32_t material_ = 0;
  std::vector<Item> items_;
};

}  // namespace

StatusOr<GatherWork> build_gather_work(const scene::GpuScene& gpu_scene,
                                       std::span<const atlas::Placement> placements,
                                       const GatherLimits& limits) {
  const scene::Scene& scene = gpu_scene.scene();
  GatherWork work;
  Items items(limits, work);
  InstanceFinder finder(scene);
  for (const Placement& p : placements) {
    if (p.patch >= scene.patch_count)
      return absl::InvalidArgumentError(
          absl::StrFormat("gather: placement of patch %u, the scene has %u", p.patch, scene.patch_count));
    const uint32_t instance = finder.find(p.patch);
    const scene::Instance& owner = scene.instances[instance];
    const scene::Patch& patch = finder.geometry(instance).patches[p.patch - owner.first_patch];
    TESSERA_RETURN_IF_ERROR(check_part(p, patch.triangle_count));
    const bool whole = p.part == atlas::kWholePatch;
    const uint32_t triangle = patch.first_triangle + (whole ? 0 : p.triangle());
    const BlockRecord first{.instance = instance,
                            .first_triangle = gpu_scene.first_index(owner.geometry) / 3 + triangle,
                            .shape = whole ? patch.triangle_count : 1};
    TESSERA_RETURN_IF_ERROR(items.add(p, first, owner.material));
  }
  const std::vector<uint32_t> order = order_by_material(items.items(), scene.materials.size());
  add_compute(work, items.items(), order);
  add_raster(work, items.items(), order);
  add_tessellation(work, items.items(), order);
  return work;
}

}  // namespace tessera::shading
