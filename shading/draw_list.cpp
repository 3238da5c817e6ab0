#include "shading/draw_list.h"

#include <cmath>

namespace tessera::shading {
namespace {

gpu::Cull cull_of(const scene::Material& material, const dmat4& transform, bool both_sides) {
  if (both_sides || material.double_sided) return gpu::Cull::none;
  return glm::determinant(glm::dmat3(transform)) < 0 ? gpu::Cull::front : gpu::Cull::back;
}

void append(std::vector<DrawRange>& ranges, const DrawRange& range) {
  if (!ranges.empty()) {
    DrawRange& last = ranges.back();
    if (last.instance == range.instance &&
        last.first_triangle + last.triangle_count == range.first_triangle) {
      last.triangle_count += range.triangle_count;
      return;
    }
  }
  ranges.push_back(range);
}

}  // namespace

WorldSphere transform_sphere(const dmat4& transform, vec3 center, float radius) {
  // Gershgorin bound of the greatest eigenvalue of MᵀM: exact for a scaled rotation, safe with shear.
  const glm::dmat3 m(transform);
  const glm::dmat3 squares = glm::transpose(m) * m;
  double greatest = 0;
  for (int i = 0; i < 3; ++i)
    greatest = std::max(greatest, std::abs(squares[i].x) + std::abs(squares[i].y) + std::abs(squares[i].z));
  return {dvec3(transform * glm::dvec4(dvec3(center), 1.0)), std::sqrt(greatest) * radius};
}

Frustum::Frustum(const mat4& clip_from_relative, const dvec3& origin, bool ignore_depth) : origin_(origin) {
  const dmat4 rows = glm::transpose(dmat4(clip_from_relative));
  planes_ = {rows[3] + rows[0], rows[3] - rows[0], rows[3] + rows[1], rows[3] - rows[1]};
  if (!ignore_depth)
    planes_.push_back(rows[3] - rows[2]);  // reversed depth: the near plane; the far one is at infinity
  for (glm::dvec4& plane : planes_) plane /= std::max(glm::length(dvec3(plane)), 1e-300);
}

Frustum::Side Frustum::classify(const WorldSphere& sphere) const {
  const glm::dvec4 center(sphere.center - origin_, 1.0);
  Side side = Side::inside;
  for (const glm::dvec4& plane : planes_) {
    const double distance = glm::dot(plane, center);
    if (distance < -sphere.radius) return Side::outside;
    if (distance < sphere.radius) side = Side::crossing;
  }
  return side;
}

DrawList build_draw_list(const scene::GpuScene& gpu_scene, const scene::SceneInstant& instant,
                         const Frustum& frustum, bool both_sides) {
  const scene::Scene& scene = gpu_scene.scene();
  DrawList list;
  for (uint32_t i = 0; i < scene.instances.size(); ++i) {
    const scene::Instance& instance = scene.instances[i];
    const scene::Geometry& geometry = scene.geometries[instance.geometry];
    const scene::Material& material = scene.materials[instance.material];
    if (geometry.bounds.empty()) continue;
    const dmat4& transform = instant.instance_transforms()[i];
    const float radius = 0.5f * glm::length(geometry.bounds.extent());
    const auto side = frustum.classify(transform_sphere(transform, geometry.bounds.center(), radius));
    if (side == Frustum::Side::outside) continue;

    auto& ranges = material.alpha_mode == scene::AlphaMode::mask ? list.masked : list.opaque;
    const uint32_t first = gpu_scene.first_index(instance.geometry) / 3;
    const gpu::Cull cull = cull_of(material, transform, both_sides);
    if (side == Frustum::Side::inside) {
      append(ranges, {i, first, geometry.triangle_count(), cull});
      continue;
    }
    for (const scene::Meshlet& meshlet : geometry.meshlets)
      if (frustum.classify(transform_sphere(transform, meshlet.center, meshlet.radius)) !=
          Frustum::Side::outside)
        append(ranges, {i, first + meshlet.first_triangle, meshlet.triangle_count, cull});
  }
  return list;
}

}  // namespace tessera::shading
