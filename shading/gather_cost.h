// What a sample costs on each path of the gather, measured on the device at hand.
#pragma once

#include <span>
#include <vector>

#include "shading/gather.h"

namespace tessera::shading {

// One shape of a size, to be shaded many times over.
struct LoadShape {
  GatherShape shape = GatherShape::block;
  uint32_t size = 2;   // block: side in texels, even; L: level; half: intervals along the height
  uint32_t along = 1;  // half: intervals along each half's part of the base
};
struct LoadTriangle {
  scene::PatchId patch = 0;
  uint32_t triangle = 0;  // of the patch
  bool operator==(const LoadTriangle&) const = default;
};
// Placements of `shape` for the triangles (blocks: for their patches) in turn, about so many samples, fewer
// if the atlas is full; sorted as layouts give them. The triangles' materials must not be masked. No
// triangles: none.
std::vector<atlas::Placement> make_load(const LoadShape& shape, std::span<const LoadTriangle> triangles,
                                        uint64_t samples, uint32_t atlas_width, uint32_t atlas_height);

struct CostSettings {
  // A timing, about: what keeps a device busy for much longer than its passes take to begin. With few, a
  // dispatch a material weighs more than samples do.
  uint32_t samples = 1u << 18;
  uint32_t rounds = 3;  // the least time of which counts: what disturbs it only adds; one more warms up
};
// Times every path on made-up placements of the scene's own patches, with its materials and lights: what is
// dear in one scene is cheap in another. `lighting` must be up to date for `instant`, which must be set.
// Blocks. A scene without opaque patches gives zeros.
StatusOr<GatherCosts> measure_gather_costs(gpu::Device& device, const scene::GpuScene& scene,
                                           const scene::SceneInstant& instant, const Lighting& lighting,
                                           const CostSettings& settings = {});

}  // namespace tessera::shading
