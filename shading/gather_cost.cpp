#include "shading/gather_cost.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "atlas/addressing/addressing.h"
#include "atlas/tessellated/packing.h"
#include "shading/tessellator.h"

namespace tessera::shading {
namespace {

using atlas::Placement;
using atlas::PlacementKind;
namespace addressing = atlas::addressing;

constexpr uint32_t kAtlasSide = 2048;  // of the timings
constexpr uint32_t kTriangles = 1024;  // of the scene that are tried

constexpr uint32_t kBlockSides[] = {2, 4, 8, 16, 32, 64, 128};
constexpr uint32_t kLevels[] = {1, 2, 4, 8, 16, 32, 64};
constexpr uint32_t kHalfWidths[] = {2, 4, 8, 16, 32, 64};
constexpr uint32_t kHalfSlant = 2;  // intervals along the base, one across

// One for each kind of shape: where the next one lies.
class Packer {
 public:
  Packer(const LoadShape& shape, uint32_t width, uint32_t height)
      : shape_(shape), rows_(width, height), ls_(rows_, shape.size), halves_(rows_) {}

  bool place(Placement& p) {
    switch (shape_.shape) {
      case GatherShape::block:
        return place_block(p);
      case GatherShape::l:
        p.kind = PlacementKind::l;
        p.l.level = static_cast<uint8_t>(shape_.size);
        return ls_.place(p);
      case GatherShape::half:
        return place_halves(p);
    }
    return false;
  }

 private:
  bool place_block(Placement& p) {
    const std::optional<uvec2> at = rows_.place(shape_.size, shape_.size);
    if (!at) return false;
    p.kind = PlacementKind::block;
    p.x = static_cast<uint16_t>(at->x);
    p.y = static_cast<uint16_t>(at->y);
    p.width = p.height = static_cast<uint16_t>(shape_.size);
    return true;
  }

  bool place_halves(Placement& p) {
    p.kind = PlacementKind::halves;
    p.halves.across = static_cast<uint8_t>(shape_.size);
    p.halves.foot = 31;
    const ivec2 stairs =
        addressing::half_staircase(static_cast<int>(shape_.size), static_cast<int>(shape_.along));
    for (atlas::HalfPlace& half : p.halves.half) {
      half.along = static_cast<uint16_t>(shape_.along);
      if (!halves_.place(stairs, half)) return false;
    }
    return true;
  }

  const LoadShape shape_;
  atlas::tessellated::Rows rows_;
  atlas::tessellated::LBin ls_;
  atlas::tessellated::HalfBin halves_;
};

// Spread over the scene, and so is any part from the first on: large shapes need few.
std::vector<LoadTriangle> opaque_triangles(const scene::Scene& scene) {
  std::vector<LoadTriangle> triangles;
  const uint32_t step = std::max(1u, scene.patch_count / kTriangles);
  for (scene::PatchId patch = 0; patch < scene.patch_count; patch += step) {
    const scene::Instance& instance = scene.instances[scene.instance_of(patch)];
    if (scene.materials[instance.material].alpha_mode == scene::AlphaMode::opaque)
      triangles.push_back({patch, 0});
  }
  std::shuffle(triangles.begin(), triangles.end(), std::minstd_rand(1));
  return triangles;
}

std::vector<LoadShape> timed_shapes() {
  std::vector<LoadShape> shapes;
  for (const uint32_t side : kBlockSides) shapes.push_back({GatherShape::block, side});
  for (const uint32_t level : kLevels) shapes.push_back({GatherShape::l, level});
  for (const uint32_t across : kHalfWidths)
    shapes.push_back({GatherShape::half, across, kHalfSlant * across});
  return shapes;
}

double samples_of(const LoadShape& shape) {
  const auto size = static_cast<int>(shape.size);
  if (shape.shape == GatherShape::block) return static_cast<double>(size) * size;
  if (shape.shape == GatherShape::l) return addressing::l_samples(size);
  return addressing::staircase_samples(addressing::half_staircase(size, static_cast<int>(shape.along)));
}

struct Timing {
  LoadShape shape;
  std::array<double, std::size(kGatherPaths)> ns{};  // infinite: it cannot
};

// Between the measured sizes linear in the logarithm, beyond them as the nearest.
double interpolated(std::span<const Timing> by_size, size_t path, double log_samples) {
  const auto log_of = [](const Timing& t) { return std::log2(samples_of(t.shape)); };
  for (size_t i = 0; i < by_size.size(); ++i) {
    const double log = log_of(by_size[i]);
    if (log_samples > log && i + 1 < by_size.size()) continue;
    if (i == 0 || log_samples >= log) return by_size[i].ns[path];
    if (std::isinf(by_size[i].ns[path])) return by_size[i].ns[path];
    const double before = log_of(by_size[i - 1]), t = (log_samples - before) / (log - before);
    return std::lerp(by_size[i - 1].ns[path], by_size[i].ns[path], t);
  }
  return 0;
}

GatherCosts table_of(const std::vector<Timing>& timings) {
  GatherCosts costs;
  for (size_t shape = 0; shape < kGatherShapes; ++shape) {
    std::vector<Timing> by_size;
    std::ranges::copy_if(timings, std::back_inserter(by_size),
                         [&](const Timing& t) { return t.shape.shape == static_cast<GatherShape>(shape); });
    for (size_t size = 0; size < kSizeClasses; ++size)
      for (size_t path = 0; path < std::size(kGatherPaths); ++path)  // a class's middle
        costs.ns[shape][size][path] = interpolated(by_size, path, static_cast<double>(size) + 0.5);
  }
  return costs;
}

// One load on one path, in ns a sample.
StatusOr<double> time_load(gpu::Device& device, Gather& gather, const scene::SceneInstant& instant,
                           std::span<const Placement> load, GatherPath path) {
  // Pixels about as wide as texels are in a frame: textures are filtered for them.
  View viewer{.fov = Fov::symmetric(1, 1), .width = 1024, .height = 1024};
  viewer.pose.position = instant.origin();
  TESSERA_RETURN_IF_ERROR(gather.choose(only(path)));
  gpu::Commands commands = device.begin();
  TESSERA_RETURN_IF_ERROR(gather.record(commands, instant, viewer, load));
  TESSERA_RETURN_IF_ERROR(device.run(std::move(commands)));
  const GatherStats& stats = gather.stats();
  return stats.samples ? 1e6 * stats.gpu_ms / static_cast<double>(stats.samples) : 0;
}

}  // namespace

std::vector<Placement> make_load(const LoadShape& shape, std::span<const LoadTriangle> triangles,
                                 uint64_t samples, uint32_t atlas_width, uint32_t atlas_height) {
  std::vector<Placement> load;
  Packer packer(shape, atlas_width, atlas_height);
  for (uint64_t placed = 0, i = 0; placed < samples && !triangles.empty(); ++i) {
    const LoadTriangle& triangle = triangles[i % triangles.size()];
    Placement p{.patch = triangle.patch};
    if (shape.shape != GatherShape::block) p.part = atlas::part_of(triangle.triangle);
    if (!packer.place(p)) break;
    placed += p.texels();
    load.push_back(p);
  }
  // As layouts give them.
  std::ranges::stable_sort(load, {}, [](const Placement& p) { return std::pair(p.patch, p.part); });
  return load;
}

StatusOr<GatherCosts> measure_gather_costs(gpu::Device& device, const scene::GpuScene& scene,
                                           const scene::SceneInstant& instant, const Lighting& lighting,
                                           const CostSettings& settings) {
  const std::vector<LoadTriangle> triangles = opaque_triangles(scene.scene());
  if (triangles.empty()) return GatherCosts{};
  TESSERA_ASSIGN_OR_RETURN(const auto gather, Gather::create(device, scene, lighting,
                                                             {.width = kAtlasSide, .height = kAtlasSide}));
  const bool tessellates = check_tessellator(device).ok();
  std::vector<Timing> timings;
  for (const LoadShape& shape : timed_shapes()) {
    const std::vector<Placement> load = make_load(shape, triangles, settings.samples, kAtlasSide, kAtlasSide);
    std::array<std::vector<double>, std::size(kGatherPaths)> rounds;
    for (uint32_t round = 0; round <= settings.rounds; ++round)  // the first warms up
      for (size_t path = 0; path < rounds.size(); ++path) {
        if (!can_shade(kGatherPaths[path], shape.shape)) continue;
        if (kGatherPaths[path] == GatherPath::tessellation && !tessellates) continue;
        TESSERA_ASSIGN_OR_RETURN(const double ns,
                                 time_load(device, *gather, instant, load, kGatherPaths[path]));
        if (round > 0) rounds[path].push_back(ns);
      }
    Timing timing{shape};
    for (size_t path = 0; path < rounds.size(); ++path)
      timing.ns[path] =
          rounds[path].empty() ? std::numeric_limits<double>::infinity() : std::ranges::min(rounds[path]);
    timings.push_back(timing);
  }
  return table_of(timings);
}

}  // namespace tessera::shading
