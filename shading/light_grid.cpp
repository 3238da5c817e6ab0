#include "shading/light_grid.h"

#include <algorithm>
#include <cmath>

namespace tessera::shading {
namespace {

constexpr double kCellM = 1.5;                   // wished side of a cell
constexpr uint32_t kMaxCells[3] = {32, 16, 32};  // flatter than wide, as scenes are

struct Sphere {
  dvec3 center;
  double radius;  // 0 = everywhere
};

double distance_to_box(const dvec3& p, const dvec3& min, const dvec3& max) {
  return glm::length(glm::max(glm::max(min - p, p - max), dvec3(0)));
}

}  // namespace

LightGrid build_light_grid(std::span<const PlacedLight> lights) {
  std::vector<Sphere> spheres;
  dvec3 min(std::numeric_limits<double>::infinity()), max(-min);
  for (const PlacedLight& l : lights) {
    spheres.push_back({l.position, std::max(l.light.range, 0.0f)});
    if (l.light.range <= 0) continue;
    min = glm::min(min, l.position - double{l.light.range});
    max = glm::max(max, l.position + double{l.light.range});
  }
  LightGrid grid;
  dvec3 cell(1);
  if (min.x <= max.x) {
    grid.min = min;
    for (int a = 0; a < 3; ++a) {
      const double extent = max[a] - min[a];
      grid.size[a] =
          std::clamp(static_cast<uint32_t>(std::min(std::ceil(extent / kCellM), 1e3)), 1u, kMaxCells[a]);
      cell[a] = std::max(extent / grid.size[a], 1e-6);
    }
  }
  grid.cells_per_m = vec3(1.0 / cell);

  const auto add_cell = [&](auto reaches) {
    const auto first = static_cast<uint32_t>(grid.lights.size());
    for (uint32_t i = 0; i < spheres.size(); ++i)
      if (spheres[i].radius == 0 || reaches(spheres[i])) grid.lights.push_back(i);
    grid.cells.push_back({first, static_cast<uint32_t>(grid.lights.size()) - first});
  };
  for (uint32_t z = 0; z < grid.size[2]; ++z)
    for (uint32_t y = 0; y < grid.size[1]; ++y)
      for (uint32_t x = 0; x < grid.size[0]; ++x) {
        const dvec3 low = grid.min + cell * dvec3(x, y, z);
        // A hair wider than the cell: the shader's float arithmetic may put a point next door.
        add_cell([&](const Sphere& s) {
          return distance_to_box(s.center, low - 1e-3 * cell, low + 1.001 * cell) <= s.radius;
        });
      }
  add_cell([](const Sphere&) { return false; });
  return grid;
}

}  // namespace tessera::shading
