// Which triangles a forward pass draws: instances and meshlets tested against a frustum on the CPU.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "gpu/commands.h"
#include "scene/gpu_scene.h"

namespace tessera::shading {

// Consecutive triangles of one instance.
struct DrawRange {
  uint32_t instance;
  uint32_t first_triangle;  // in GpuScene::indices() / 3
  uint32_t triangle_count;
  gpu::Cull cull;  // what the material and a mirroring transform make of back faces
};

// In instance order, so that coplanar surfaces resolve alike in every view.
struct DrawList {
  std::vector<DrawRange> opaque, masked;
};

// A meshlet's or instance's bounding sphere in world coordinates.
struct WorldSphere {
  dvec3 center;
  double radius;
};
WorldSphere transform_sphere(const dmat4& transform, vec3 center, float radius);

// Planes through which a sphere may be seen; positions relative to an origin.
class Frustum {
 public:
  // `ignore_depth`: the four sides only (depth clamp).
  Frustum(const mat4& clip_from_relative, const dvec3& origin, bool ignore_depth);
  enum class Side { outside, crossing, inside };
  Side classify(const WorldSphere& sphere) const;

 private:
  std::vector<glm::dvec4> planes_;  // unit normals
  dvec3 origin_;
};

// The ranges that a frustum may see. `both_sides`: back faces are drawn as well (shadow casters).
DrawList build_draw_list(const scene::GpuScene& scene, const scene::SceneInstant& instant,
                         const Frustum& frustum, bool both_sides);

// One draw a range, after `before_draw(range)` has bound and pushed what it needs, culling included.
template <class BeforeDraw>
void record_draws(gpu::Commands& commands, std::span<const DrawRange> ranges, BeforeDraw before_draw) {
  for (const DrawRange& range : ranges) {
    before_draw(range);
    commands.draw_indexed(3 * range.triangle_count, 1, 3 * range.first_triangle, 0, range.instance);
  }
}

}  // namespace tessera::shading
