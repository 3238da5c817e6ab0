// Puts a procedural scene together.
#pragma once

#include <memory>

#include "scene/mesh/source_mesh.h"
#include "scene/procedural/textures.h"

namespace tessera::scene {

class SceneBuilder {
 public:
  explicit SceneBuilder(std::string name);

  // A material with the surface's three textures.
  uint32_t add_material(const std::string& name, const Surface& surface);
  // A double-sided material cut out by the alpha of `mask`.
  uint32_t add_cutout(const std::string& name, Texture mask, float roughness);
  uint32_t add_material(Material material);
  Material& material(uint32_t index) { return scene_->materials[index]; }

  uint32_t add_node(const dvec3& translation, const dquat& rotation = dquat(1, 0, 0, 0),
                    const dvec3& scale = dvec3(1), uint32_t parent = 0);
  // Node 0 is the scene's root.
  uint32_t add_geometry(const std::string& name, SourceMesh mesh);
  void place(uint32_t geometry, uint32_t material, uint32_t node = 0);
  // The mesh as geometry with one instance.
  void add(const std::string& name, SourceMesh mesh, uint32_t material, uint32_t node = 0);

  void add_light(Light light, const dvec3& position, const dvec3& direction = dvec3(0, -1, 0));
  void animate(AnimationChannel channel) { scene_->animations.push_back(std::move(channel)); }
  // Whole turns around the node's y axis.
  void spin(uint32_t node, double turns, double length_s);

  uint32_t triangle_count(uint32_t geometry) const { return scene_->geometries[geometry].triangle_count(); }
  std::shared_ptr<Scene> finish(double animation_length_s);

 private:
  uint32_t add_texture(Texture texture);
  std::shared_ptr<Scene> scene_;
};

// The rotation that turns -z towards `direction`.
dquat look_along(const dvec3& direction);

}  // namespace tessera::scene
