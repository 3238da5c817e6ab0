#include "shading/gather_work.h"

namespace tessera::shading {
namespace {

struct Item {
  BlockRecord record;
  uint32_t material;
  bool raster;
};

uint32_t shape_of(const atlas::Placement& p, uint32_t triangle_count) {
  if (p.kind == atlas::PlacementKind::color) return triangle_count | kBlockColor;
  return triangle_count | (p.transposed ? kBlockTransposed : 0) | (p.masked ? kBlockMasked : 0);
}

uint32_t size_of(const atlas::Placement& p) {
  return p.kind == atlas::PlacementKind::color ? 1u | 1u << 16 : p.width | uint32_t{p.height} << 16;
}

uint32_t spacing_of(const atlas::Placement& p) {
  uint32_t codes = 0;
  for (size_t i = 0; i < p.spacing.size(); ++i)
    codes |= uint32_t{static_cast<uint8_t>(p.spacing[i])} << (8 * i);
  return codes;
}

Status check(const atlas::Placement& p, uint32_t patch_count, const GatherLimits& limits) {
  if (p.patch >= patch_count)
    return absl::InvalidArgumentError(
        absl::StrFormat("gather: placement of patch %u, the scene has %u", p.patch, patch_count));
  if (p.kind == atlas::PlacementKind::color) return absl::OkStatus();
  if (p.width == 0 || p.height == 0 || p.x + p.width > limits.width || p.y + p.height > limits.height)
    return absl::InvalidArgumentError(
        absl::StrFormat("gather: block of %ux%u texels at (%u, %u) is empty or leaves the %ux%u atlas",
                        p.width, p.height, p.x, p.y, limits.width, limits.height));
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

uint64_t item_samples(const BlockRecord& r) {
  return uint64_t{r.size & 0xffff} * (r.size >> 16);
}

// Appends compute blocks and the start of every chunk; each material's samples fill whole chunks.
void add_compute(GatherWork& work, std::span<const Item> items, std::span<const uint32_t> order) {
  uint64_t next = 0;  // sample
  uint32_t material = ~0u;
  for (uint32_t i : order) {
    if (items[i].raster) continue;
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
    work.compute_samples += samples;
    if (!(block.shape & kBlockColor)) ++work.compute_blocks;
  }
  work.blocks.push_back({.first_sample = ~0u});
}

void add_raster(GatherWork& work, std::span<const Item> items, std::span<const uint32_t> order) {
  uint32_t material = ~0u;
  for (uint32_t i : order) {
    if (!items[i].raster) continue;
    if (items[i].material != material)
      work.raster_batches.push_back({items[i].material, static_cast<uint32_t>(work.blocks.size()), 0});
    material = items[i].material;
    ++work.raster_batches.back().block_count;
    ++work.raster_blocks;
    work.raster_samples += item_samples(items[i].record);
    work.blocks.push_back(items[i].record);
  }
}

}  // namespace

StatusOr<GatherWork> build_gather_work(const scene::GpuScene& gpu_scene,
                                       std::span<const atlas::Placement> placements,
                                       const GatherLimits& limits) {
  const scene::Scene& scene = gpu_scene.scene();
  GatherWork work;
  std::vector<Item> items;
  items.reserve(placements.size());
  InstanceFinder finder(scene);
  for (const atlas::Placement& p : placements) {
    TESSERA_RETURN_IF_ERROR(check(p, scene.patch_count, limits));
    const uint32_t instance = finder.find(p.patch);
    const scene::Instance& owner = scene.instances[instance];
    const scene::Patch& patch = finder.geometry(instance).patches[p.patch - owner.first_patch];
    const bool color = p.kind == atlas::PlacementKind::color;
    items.push_back(
        {.record = {.instance = instance,
                    .first_triangle = gpu_scene.first_index(owner.geometry) / 3 + patch.first_triangle,
                    .place = color ? work.colors++ : p.x | uint32_t{p.y} << 16,
                    .size = size_of(p),
                    .shape = shape_of(p, patch.triangle_count),
                    .spacing = spacing_of(p)},
         .material = owner.material,
         .raster = !color && p.texels() >= limits.raster_from_texels});
  }
  const std::vector<uint32_t> order = order_by_material(items, scene.materials.size());
  add_compute(work, items, order);
  add_raster(work, items, order);
  return work;
}

}  // namespace tessera::shading
