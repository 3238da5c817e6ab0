// What layouts ask about a patch, one byte a patch of the whole scene.
#pragma once

#include <cstdint>
#include <vector>

#include "scene/scene.h"

namespace tessera::atlas {

struct PatchTraits {
  uint8_t triangle_count = 1;  // a lone triangle fills half of its block
  bool masked = false;         // needs two halves
};

class PatchTraitTable {
 public:
  explicit PatchTraitTable(const scene::Scene& scene);
  PatchTraits operator[](scene::PatchId patch) const;

 private:
  std::vector<uint8_t> bits_;
};

}  // namespace tessera::atlas
