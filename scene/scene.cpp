#include "scene/scene.h"

#include <algorithm>

namespace tessera::scene {

uint32_t Scene::instance_of(PatchId patch) const {
  const auto after = std::upper_bound(instances.begin(), instances.end(), patch,
                                      [](PatchId p, const Instance& i) { return p < i.first_patch; });
  return static_cast<uint32_t>(after - instances.begin()) - 1;
}

Aabb Scene::world_bounds(TimeNs time_ns) const {
  const std::vector<dmat4> worlds = node_transforms(time_ns);
  Aabb world;
  for (const Instance& instance : instances) {
    const Aabb& box = geometries[instance.geometry].bounds;
    if (box.empty()) continue;
    for (int corner = 0; corner < 8; ++corner) {
      const dvec3 p(corner & 1 ? box.max.x : box.min.x, corner & 2 ? box.max.y : box.min.y,
                    corner & 4 ? box.max.z : box.min.z);
      world.add(vec3(worlds[instance.node] * glm::dvec4(p, 1.0)));
    }
  }
  return world;
}

vec2 patch_corner(uint32_t count, uint32_t triangle, uint32_t corner) {
  struct Corner {
    float u, v;
  };
  // thesis figs. 3.3, 3.4
  static constexpr Corner kPair[2][3] = {{{0, 0}, {1, 0}, {0, 1}}, {{1, 1}, {0, 1}, {1, 0}}};
  static constexpr Corner kFan[3][3] = {
      {{0, 0}, {1, 0}, {.5f, 1}}, {{0, 1}, {0, 0}, {.5f, 1}}, {{1, 0}, {1, 1}, {.5f, 1}}};
  const Corner& c = count == 3 ? kFan[triangle][corner] : kPair[triangle][corner];
  return vec2(c.u, c.v);
}

}  // namespace tessera::scene
