// A uniform grid over the reach of the local lights: a sample evaluates only the lights that may reach its
// cell.
#pragma once

#include <span>
#include <vector>

#include "shading/light_list.h"

namespace tessera::shading {

struct LightGrid {
  dvec3 min{0};  // world
  vec3 cells_per_m{1};
  uint32_t size[3] = {1, 1, 1};
  // size[0] * size[1] * size[2] cells, x fastest, and one more for everything outside.
  std::vector<LightCell> cells;
  std::vector<uint32_t> lights;  // by cell, indices into the lights that the grid was built from

  uint32_t outside_cell() const { return static_cast<uint32_t>(cells.size()) - 1; }
};

// Lights without a range are in every cell.
LightGrid build_light_grid(std::span<const PlacedLight> lights);

}  // namespace tessera::shading
