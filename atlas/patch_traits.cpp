#include "atlas/patch_traits.h"

#include <cassert>

namespace tessera::atlas {
namespace {

constexpr uint8_t kMasked = 0x80;

}  // namespace

PatchTraitTable::PatchTraitTable(const scene::Scene& scene) : bits_(scene.patch_count) {
  for (const scene::Instance& instance : scene.instances) {
    const bool masked = instance.material < scene.materials.size() &&
                        scene.materials[instance.material].alpha_mode == scene::AlphaMode::mask;
    uint8_t* bits = bits_.data() + instance.first_patch;
    for (const scene::Patch& patch : scene.geometries[instance.geometry].patches) {
      *bits++ = static_cast<uint8_t>(patch.triangle_count | (masked ? kMasked : 0));
    }
  }
}

PatchTraits PatchTraitTable::operator[](scene::PatchId patch) const {
  assert(patch < bits_.size());
  const uint8_t bits = bits_[patch];
  return {static_cast<uint8_t>(bits & ~kMasked), (bits & kMasked) != 0};
}

}  // namespace tessera::atlas
