#include "bench/stability_fill.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "bench/stability_mesh.h"

namespace tessera::bench {
namespace {

using atlas::LayoutKind;
using atlas::Placement;
using atlas::PlacementKind;
using Measures = std::vector<StabilityMeasure>;

constexpr uint32_t kAtlasSide = 256;
constexpr uint32_t kSuperblockLog = 5;  // of layout blocks

// Quads far apart, one patch each, that all ask for the same samples.
class EqualPatches {
 public:
  static StatusOr<EqualPatches> create(uint32_t count, float side_px) {
    StabilityMesh mesh;
    for (uint32_t i = 0; i < count; ++i) {
      const auto first = static_cast<uint32_t>(mesh.positions.size());
      for (const vec2 uv : {vec2(0, 0), vec2(1, 0), vec2(0, 1), vec2(1, 1)})
        mesh.add({2 * static_cast<float>(i) + uv.x, uv.y, -1}, uv);
      mesh.add_triangle(first, first + 1, first + 2);
      mesh.add_triangle(first + 3, first + 2, first + 1);
    }
    EqualPatches patches(side_px);
    TESSERA_ASSIGN_OR_RETURN(const ImportedMesh imported, import_mesh(mesh));
    patches.scene_ = imported.scene;
    if (patches.scene_->patch_count != count) return absl::InternalError("quads did not become patches");
    return patches;
  }

  const scene::Scene& scene() const { return *scene_; }
  scene::VisiblePatches first(uint32_t count) const {
    scene::VisiblePatches visible;
    for (uint32_t patch = 0; patch < count; ++patch)
      visible.push_back({patch, {side_px_, side_px_, side_px_ * side_px_}});
    return visible;
  }

 private:
  explicit EqualPatches(float side_px) : side_px_(side_px) {}
  std::shared_ptr<const scene::Scene> scene_;
  float side_px_;
};

// Texels that two placements have, or that lie outside.
double misplaced_texels(std::span<const Placement> placements) {
  std::vector<uint8_t> taken(size_t{kAtlasSide} * kAtlasSide);
  double wrong = 0;
  for (const Placement& p : placements)
    atlas::visit_samples(p, kAtlasSide, [&](const atlas::TexelRectangle& r) {
      for (uint32_t y = r.y; y < r.y + r.height; ++y)
        for (uint32_t x = r.x; x < r.x + r.width; ++x)
          wrong += x >= kAtlasSide || y >= kAtlasSide || taken[size_t{y} * kAtlasSide + x]++ > 0;
    });
  return wrong;
}

uint32_t patches_with_samples(std::span<const Placement> placements) {
  uint32_t count = 0;
  scene::PatchId last = scene::kNone;
  for (const Placement& p : placements)
    if (p.kind != PlacementKind::color && std::exchange(last, p.patch) != p.patch) ++count;
  return count;
}

// A layout whose levels follow the footprints alone.
StatusOr<std::unique_ptr<atlas::Layout>> unbiased(const scene::Scene& scene, LayoutKind kind) {
  atlas::LayoutSettings settings = atlas::layout_settings(kind, kAtlasSide, kAtlasSide);
  if (kind == LayoutKind::blocks) {
    settings.superblock_log = kSuperblockLog;
    settings.levels.max_log = kSuperblockLog;
  }
  settings.levels.min_bias = settings.levels.max_bias = 0;
  return atlas::create_layout(scene, settings);
}

struct Fill {
  double misplaced = 0;  // texels, of all frames together
  double lost = 0;       // patches without any placement
  double starved = 0;    // patches without samples while the atlas holds exactly all
  double spilled = 0;    // patches without samples when there is one too many
  double not_reused = 0;
  double free_texels = 0;
};

class Filler {
 public:
  static StatusOr<Fill> run(const EqualPatches& patches, uint32_t count, LayoutKind kind) {
    Filler filler(patches);
    // So many find room: with far more than fit, those without samples are the rest.
    TESSERA_ASSIGN_OR_RETURN(filler.layout_, unbiased(patches.scene(), kind));
    filler.show(count);
    const uint32_t capacity = patches_with_samples(filler.layout_->placements());
    if (capacity == 0 || capacity == count) return absl::InternalError("the case does not fill the atlas");
    TESSERA_ASSIGN_OR_RETURN(filler.layout_, unbiased(patches.scene(), kind));
    filler.show(capacity);
    filler.fill_.starved = capacity - patches_with_samples(filler.layout_->placements());
    filler.fill_.free_texels = static_cast<double>(kAtlasSide * kAtlasSide) -
                               static_cast<double>(filler.layout_->stats().used_texels);
    filler.show(capacity + 1);
    filler.fill_.spilled = capacity + 1.0 - patches_with_samples(filler.layout_->placements());
    // One goes, and its texels serve another: the last room of a full atlas.
    filler.show(capacity - 1);
    filler.show(capacity);
    filler.fill_.not_reused = capacity - patches_with_samples(filler.layout_->placements());
    return filler.fill_;
  }

 private:
  explicit Filler(const EqualPatches& patches) : patches_(patches) {}

  void show(uint32_t count) {
    const scene::VisiblePatches visible = patches_.first(count);
    const std::vector<dmat4> transforms(patches_.scene().instances.size(), dmat4(1));
    layout_->update({visible, dvec3(0), transforms});
    fill_.misplaced += misplaced_texels(layout_->placements());
    std::vector<uint8_t> placed(count);
    for (const Placement& p : layout_->placements()) placed[p.patch] = 1;
    fill_.lost += static_cast<double>(count) - static_cast<double>(std::ranges::count(placed, 1));
  }

  const EqualPatches& patches_;
  std::unique_ptr<atlas::Layout> layout_;
  Fill fill_;
};

// All patches ask for samples of side x side.
StatusOr<Measures> fill_with(uint32_t side) {
  Measures measures;
  for (const LayoutKind kind : {LayoutKind::blocks, LayoutKind::coherent, LayoutKind::tessellated}) {
    const uint32_t squares = kAtlasSide / side, count = squares * squares * 3 + 64;
    TESSERA_ASSIGN_OR_RETURN(const EqualPatches patches,
                             EqualPatches::create(count, static_cast<float>(side)));
    TESSERA_ASSIGN_OR_RETURN(const Fill fill, Filler::run(patches, count, kind));
    const std::string name(atlas::kLayoutNames[static_cast<size_t>(kind)]);
    measures.push_back(
        {"misplaced texels, " + name, fill.misplaced, 0, "a texel has one owner, in the atlas"});
    measures.push_back({"patches lost, " + name, fill.lost, 0, "what has no room gets a single colour"});
    measures.push_back({"without samples when full, " + name, fill.starved, 0, "so many found room before"});
    measures.push_back(
        {"without samples, one too many, " + name, fill.spilled, 1, "the rest keep their places"});
    measures.push_back(
        {"room that is not used again, " + name, fill.not_reused, 0, "a place that was left is free"});
    if (kind == LayoutKind::blocks)
      measures.push_back(
          {"texels left when full, " + name, fill.free_texels, 0, "blocks of one level fill the atlas"});
  }
  return measures;
}

}  // namespace

std::vector<StabilityCase> fill_stability_cases() {
  const auto fill = [](uint32_t side) { return [side](const StabilityContext&) { return fill_with(side); }; };
  const char* kExpected = "exactly as many as fit, and one more";
  return {
      {"sampling", "full-of-2", "blocks of 2x2, all of one level, until the atlas is full", kExpected,
       fill(2)},
      {"sampling", "full-of-16", "blocks of 16x16 until the atlas is full", kExpected, fill(16)},
      {"sampling", "full-of-32", "blocks of the largest size until the atlas is full", kExpected, fill(32)},
  };
}

}  // namespace tessera::bench
