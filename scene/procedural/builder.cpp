#include "scene/procedural/builder.h"

#include <algorithm>
#include <cmath>

#include "scene/gltf/import.h"

namespace tessera::scene {

SceneBuilder::SceneBuilder(std::string name) : scene_(std::make_shared<Scene>()) {
  scene_->name = std::move(name);
  Node root;
  root.name = "root";
  scene_->nodes.push_back(root);
}

uint32_t SceneBuilder::add_texture(Texture texture) {
  scene_->textures.push_back(std::move(texture));
  return static_cast<uint32_t>(scene_->textures.size() - 1);
}

uint32_t SceneBuilder::add_material(Material material) {
  scene_->materials.push_back(std::move(material));
  return static_cast<uint32_t>(scene_->materials.size() - 1);
}

uint32_t SceneBuilder::add_material(const std::string& name, const Surface& surface) {
  Material m;
  m.name = name;
  m.base_color_texture.texture = add_texture(surface.color);
  m.normal_texture.texture = add_texture(surface.normal);
  m.metallic_roughness_texture.texture = add_texture(surface.metallic_roughness);
  return add_material(m);
}

uint32_t SceneBuilder::add_cutout(const std::string& name, Texture mask, float roughness) {
  Material m;
  m.name = name;
  m.base_color_texture.texture = add_texture(std::move(mask));
  m.metallic = 0;
  m.roughness = roughness;
  m.alpha_mode = AlphaMode::mask;
  m.double_sided = true;
  return add_material(m);
}

uint32_t SceneBuilder::add_node(const dvec3& translation, const dquat& rotation, const dvec3& scale,
                                uint32_t parent) {
  Node node;
  node.parent = parent;
  node.translation = translation;
  node.rotation = rotation;
  node.scale = scale;
  scene_->nodes.push_back(node);
  return static_cast<uint32_t>(scene_->nodes.size() - 1);
}

uint32_t SceneBuilder::add_geometry(const std::string& name, SourceMesh mesh) {
  mesh.name = name;
  for (Vertex& v : mesh.vertices) v.tangent = vec4(1, 0, 0, 1);
  drop_degenerate_triangles(mesh);
  derive_tangents(mesh, TextureRef{});  // coordinates 0, as they are
  weld_vertices(mesh);
  scene_->geometries.push_back(build_geometry(std::move(mesh)));
  return static_cast<uint32_t>(scene_->geometries.size() - 1);
}

void SceneBuilder::place(uint32_t geometry, uint32_t material, uint32_t node) {
  scene_->instances.push_back({geometry, material, node});
}

void SceneBuilder::add(const std::string& name, SourceMesh mesh, uint32_t material, uint32_t node) {
  place(add_geometry(name, std::move(mesh)), material, node);
}

void SceneBuilder::add_light(Light light, const dvec3& position, const dvec3& direction) {
  light.node = add_node(position, look_along(direction));
  scene_->lights.push_back(light);
}

void SceneBuilder::spin(uint32_t node, double turns, double length_s) {
  // Keys a third of a turn apart: slerp takes the shorter arc.
  const int keys = std::max(3, static_cast<int>(std::ceil(std::abs(turns) * 3)));
  AnimationChannel channel{node, AnimationPath::rotation, Interpolation::linear, {}, {}};
  for (int k = 0; k <= keys; ++k) {
    const double t = static_cast<double>(k) / keys, half = 0.5 * 6.283185307179586 * turns * t;
    channel.times_s.push_back(t * length_s);
    channel.values.push_back(vec4(0, std::sin(half), 0, std::cos(half)));
  }
  animate(std::move(channel));
}

std::shared_ptr<Scene> SceneBuilder::finish(double animation_length_s) {
  scene_->animation_length_s = animation_length_s;
  mark_moving_nodes(*scene_);
  scene_->index_instances();
  return scene_;
}

dquat look_along(const dvec3& direction) {
  const dvec3 d = glm::normalize(direction);
  const dvec3 up = std::abs(d.y) > 0.99 ? dvec3(1, 0, 0) : dvec3(0, 1, 0);
  const dvec3 right = glm::normalize(glm::cross(d, up));
  return glm::normalize(glm::quat_cast(glm::dmat3(right, glm::cross(right, d), -d)));
}

}  // namespace tessera::scene
