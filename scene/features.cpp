// Scene::index_instances(): ids over all instances, and what the scene contains.
#include <algorithm>
#include <cmath>
#include <limits>

#include "scene/scene.h"

namespace tessera::scene {
namespace {

struct Extremes {
  double area = 0;         // largest, m2
  double slantedness = 0;  // largest longest edge / height
};

// Over the triangles of a geometry as `world` places them.
void add_triangles(const Geometry& geometry, const dmat4& world, Extremes& extremes) {
  const glm::dmat3 linear(world);
  for (size_t i = 0; i + 2 < geometry.indices.size(); i += 3) {
    const dvec3 a(geometry.vertices[geometry.indices[i]].position);
    const dvec3 ab = linear * (dvec3(geometry.vertices[geometry.indices[i + 1]].position) - a);
    const dvec3 ac = linear * (dvec3(geometry.vertices[geometry.indices[i + 2]].position) - a);
    const dvec3 bc = ac - ab;
    const double area = 0.5 * glm::length(glm::cross(ab, ac));
    const double longest2 = std::max({glm::dot(ab, ab), glm::dot(ac, ac), glm::dot(bc, bc)});
    extremes.area = std::max(extremes.area, area);
    // height = 2 area / longest edge
    if (area > 0) extremes.slantedness = std::max(extremes.slantedness, longest2 / (2 * area));
  }
}

void add_material(const Material& m, Features& f) {
  f.alpha_mask |= m.alpha_mode == AlphaMode::mask;
  f.alpha_blend |= m.alpha_mode == AlphaMode::blend;
  f.double_sided |= m.double_sided;
  f.unlit |= m.unlit;
  f.normal_maps |= m.normal_texture.texture != kNone;
  f.metallic_roughness_maps |= m.metallic_roughness_texture.texture != kNone;
  f.emissive |= m.emissive != vec3(0);
  f.occlusion_maps |= m.occlusion_texture.texture != kNone;
  for (const TextureRef* t : {&m.base_color_texture, &m.metallic_roughness_texture, &m.normal_texture,
                              &m.emissive_texture, &m.occlusion_texture}) {
    f.second_texcoord |= t->texture != kNone && t->texcoord == 1;
  }
}

void add_lights(const std::vector<Light>& lights, Features& f) {
  for (const Light& light : lights) {
    switch (light.type) {
      case LightType::directional:
        ++f.directional_lights;
        break;
      case LightType::point:
        ++f.point_lights;
        break;
      case LightType::spot:
        ++f.spot_lights;
        break;
    }
  }
}

float to_float(double x) {
  return static_cast<float>(std::min<double>(x, std::numeric_limits<float>::max()));
}

bool has_colors(const Geometry& geometry) {
  for (const Vertex& v : geometry.vertices) {
    if (v.color != 0xffffffffu) return true;
  }
  return false;
}

}  // namespace

void Scene::index_instances() {
  features = {};
  patch_count = triangle_count = 0;
  const std::vector<dmat4> worlds = node_transforms(0);
  Extremes extremes;
  for (Instance& instance : instances) {
    const Geometry& geometry = geometries[instance.geometry];
    instance.first_patch = patch_count;
    instance.first_triangle = triangle_count;
    patch_count += static_cast<uint32_t>(geometry.patches.size());
    triangle_count += geometry.triangle_count();
    add_material(materials[instance.material], features);
    add_triangles(geometry, worlds[instance.node], extremes);
    features.rigid_animation |= nodes[instance.node].moves;
    features.mirrored_instances |= glm::determinant(glm::dmat3(worlds[instance.node])) < 0;
  }
  for (const Geometry& geometry : geometries) {
    features.unique_triangles += geometry.triangle_count();
    features.vertex_colors |= has_colors(geometry);
  }
  add_lights(lights, features);
  features.instanced_triangles = triangle_count;
  features.instanced_patches = patch_count;
  features.largest_triangle_m2 = to_float(extremes.area);
  features.most_slanted_triangle = to_float(extremes.slantedness);
}

}  // namespace tessera::scene
