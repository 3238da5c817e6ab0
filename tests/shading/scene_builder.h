// Tiny scenes for the tests of shading.
#pragma once

#include <memory>

#include "scene/scene.h"

namespace tessera::shading::test {

// Points the node's -Z (where lights shine and cameras look) along `direction`.
scene::Node node_towards(const dvec3& position, const dvec3& direction);

class SceneBuilder {
 public:
  SceneBuilder() : scene_(std::make_shared<scene::Scene>()) { scene_->name = "test"; }

  uint32_t material(const scene::Material& m);
  uint32_t texture(scene::Texture t);
  uint32_t node(const scene::Node& n);
  // A rectangle of cells x cells patches of two triangles: corner, edges along +u and +v; seen from cross(u,
  // v). uv run from 0 to 1; vertex colours are white.
  uint32_t rectangle(vec3 corner, vec3 u, vec3 v, uint32_t cells = 1);
  // One patch of 1..3 triangles over the unit square of (x, y), seen from +z; vertex colours carry (u, v, 0,
  // 1).
  uint32_t patch(uint32_t triangles);
  uint32_t instance(uint32_t geometry, uint32_t material, const scene::Node& node = {});
  void light(const scene::Light& light, const dvec3& position, const dvec3& direction);
  // Indexed and ready.
  std::shared_ptr<scene::Scene> build();
  scene::Scene& scene() { return *scene_; }

 private:
  uint32_t finish(scene::Geometry geometry);
  std::shared_ptr<scene::Scene> scene_;
};

// Lit, two-sided, with a wavy texture; masked where that has a cut.
scene::Material wavy(SceneBuilder& b, bool half_cut);

// A white-noise-like but smooth RGB texture; alpha 0 in the left half if `half_cut`.
scene::Texture wavy_texture(uint32_t side, bool half_cut);

// A tangent-space normal map of gentle bumps.
scene::Texture bumpy_texture(uint32_t side);

}  // namespace tessera::shading::test
