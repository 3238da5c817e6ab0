// Small scenes made by hand, so that these tests do not depend on the importer or the procedural scenes.
#pragma once

#include <memory>
#include <vector>

#include "scene/scene.h"

namespace tessera::pvs {

class SceneBuilder {
 public:
  SceneBuilder();

  // A box from -1 to 1, faces outward, each face cut into `cuts` by `cuts` quads. Meshlets of up to 32
  // triangles.
  uint32_t box(uint32_t cuts);
  // A quad from -1 to 1 in the plane z = 0 that faces +Z; its texture coordinates run from 0 to 1, v
  // downward.
  uint32_t quad(uint32_t cuts = 1);
  uint32_t geometry(const std::vector<vec3>& positions, const std::vector<uint32_t>& indices);
  uint32_t material(const scene::Material& material);
  uint32_t texture(const scene::Texture& texture);
  void place(uint32_t geometry, uint32_t material, const dmat4& transform, bool moves = false);
  scene::Scene& scene() { return *scene_; }
  std::shared_ptr<const scene::Scene> finish();

 private:
  void add_face(scene::Geometry& geometry, const mat3& axes, uint32_t cuts);
  uint32_t add(scene::Geometry geometry);

  std::shared_ptr<scene::Scene> scene_;
};

dmat4 transform(const dvec3& translation, const dvec3& scale = dvec3(1), double yaw = 0);

// A town of boxes of uneven scale, some mirrored, with double-sided panels and masked leaves; nothing
// coincides.
std::shared_ptr<const scene::Scene> make_town(int side, bool with_masks);

// Left half opaque, right half transparent.
scene::Texture half_mask(uint32_t size);

}  // namespace tessera::pvs
