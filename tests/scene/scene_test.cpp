// Ids over instances, and node transforms over time.
#include "scene/scene.h"

#include <gtest/gtest.h>

namespace tessera::scene {
namespace {

Geometry geometry_of(uint32_t patches) {
  Geometry g;
  for (const vec3& p : {vec3(0), vec3(1, 0, 0), vec3(0, 1, 0)}) {
    Vertex v{};
    v.position = p;
    v.color = 0xffffffffu;
    g.vertices.push_back(v);
    g.bounds.add(p);
  }
  for (uint32_t i = 0; i < patches; ++i) {
    g.patches.push_back({i, 1});
    g.indices.insert(g.indices.end(), {0, 1, 2});
  }
  return g;
}

TEST(SceneIds, EveryPatchFindsItsInstance) {
  Scene scene;
  scene.nodes.resize(1);
  scene.materials.resize(1);
  for (const uint32_t patches : {3u, 0u, 1u, 7u}) scene.geometries.push_back(geometry_of(patches));
  for (const uint32_t g : {1u, 0u, 1u, 1u, 3u, 2u, 0u, 1u}) scene.instances.push_back({g, 0, 0});
  scene.index_instances();
  EXPECT_EQ(scene.patch_count, 14u);
  EXPECT_EQ(scene.triangle_count, 14u);
  EXPECT_EQ(scene.features.unique_triangles, 11u);
  EXPECT_EQ(scene.features.instanced_patches, 14u);
  for (PatchId p = 0; p < scene.patch_count; ++p) {
    const Instance& owner = scene.instances[scene.instance_of(p)];
    EXPECT_GE(p, owner.first_patch);
    EXPECT_LT(p, owner.first_patch + scene.geometries[owner.geometry].patches.size());
  }
}

class Animated : public testing::Test {
 protected:
  // Node 0 is animated, node 1 is its child at (0, 0, 1).
  void SetUp() override {
    scene_.nodes.resize(2);
    scene_.nodes[1].parent = 0;
    scene_.nodes[1].translation = dvec3(0, 0, 1);
    scene_.animation_length_s = 4;
  }
  void add(AnimationPath path, Interpolation interpolation, std::vector<double> times,
           std::vector<vec4> values) {
    scene_.animations.push_back({0, path, interpolation, std::move(times), std::move(values)});
  }
  dvec3 parent_at(double t) const { return dvec3(scene_.node_transforms(from_seconds(t))[0][3]); }
  dvec3 child_at(double t) const { return dvec3(scene_.node_transforms(from_seconds(t))[1][3]); }
  static void expect_near(const dvec3& a, const dvec3& b) {
    EXPECT_LT(glm::distance(a, b), 1e-6) << a.x << " " << a.y << " " << a.z;
  }
  Scene scene_;
};

TEST_F(Animated, LinearClampsAndLoops) {
  add(AnimationPath::translation, Interpolation::linear, {1, 2, 3},
      {vec4(0), vec4(2, 0, 0, 0), vec4(2, 4, 0, 0)});
  expect_near(parent_at(0), dvec3(0));
  expect_near(parent_at(1.25), dvec3(0.5, 0, 0));
  expect_near(parent_at(2.5), dvec3(2, 2, 0));
  expect_near(parent_at(3.9), dvec3(2, 4, 0));
  expect_near(parent_at(4), dvec3(0));
  expect_near(parent_at(4 * 1e6 + 2.5), dvec3(2, 2, 0));
  expect_near(parent_at(-1.5), dvec3(2, 2, 0));  // 2.5 s
  expect_near(child_at(2), dvec3(2, 0, 1));
}

TEST_F(Animated, StepHoldsUntilTheNextKey) {
  add(AnimationPath::translation, Interpolation::step, {0, 2}, {vec4(1, 0, 0, 0), vec4(5, 0, 0, 0)});
  expect_near(parent_at(1.999999), dvec3(1, 0, 0));
  expect_near(parent_at(2), dvec3(5, 0, 0));
}

TEST_F(Animated, CubicSplineFollowsItsTangents) {
  // x(t) = t^3 on 0..2 is a cubic: tangents 3 t^2.
  add(AnimationPath::translation, Interpolation::cubic_spline, {0, 2},
      {vec4(9), vec4(0), vec4(0), vec4(12, 0, 0, 0), vec4(8, 0, 0, 0), vec4(9)});
  for (const double t : {0.0, 0.3, 1.0, 1.7, 2.0}) expect_near(parent_at(t), dvec3(t * t * t, 0, 0));
}

TEST_F(Animated, RotationTakesTheShorterArc) {
  const float h = std::sqrt(0.5f);
  // 90 degrees about y; the second key has the opposite sign of the same rotation.
  add(AnimationPath::rotation, Interpolation::linear, {0, 3}, {vec4(0, 0, 0, 1), vec4(0, -h, 0, -h)});
  for (const double t : {0.0, 1.0, 2.0, 3.0}) {
    const double angle = t / 3 * 1.5707963267948966;
    expect_near(child_at(t), dvec3(std::sin(angle), 0, std::cos(angle)));
  }
}

TEST_F(Animated, UnnormalisedAndZeroQuaternionsStayFinite) {
  add(AnimationPath::rotation, Interpolation::linear, {0, 2}, {vec4(0, 0, 0, 5), vec4(0)});
  for (const double t : {0.0, 1.0, 2.0}) expect_near(child_at(t), dvec3(0, 0, 1));
}

TEST_F(Animated, ScaleAndMatrixNodes) {
  add(AnimationPath::scale, Interpolation::linear, {0, 2}, {vec4(1), vec4(3)});
  scene_.nodes[1].matrix = dmat4(1);
  (*scene_.nodes[1].matrix)[3] = glm::dvec4(0, 2, 0, 1);
  expect_near(child_at(1), dvec3(0, 4, 0));
}

TEST_F(Animated, WithoutLengthTimeStandsStill) {
  scene_.animation_length_s = 0;
  add(AnimationPath::translation, Interpolation::linear, {0, 2}, {vec4(0), vec4(2)});
  expect_near(parent_at(1), dvec3(0));
}

TEST_F(Animated, WorldBoundsMove) {
  scene_.geometries.push_back(geometry_of(1));
  scene_.materials.resize(1);
  scene_.instances.push_back({0, 0, 1});
  add(AnimationPath::translation, Interpolation::linear, {0, 2}, {vec4(0), vec4(4, 0, 0, 0)});
  EXPECT_EQ(scene_.world_bounds(from_seconds(1)).min, vec3(2, 0, 1));
  EXPECT_EQ(scene_.world_bounds(from_seconds(1)).max, vec3(3, 1, 1));
}

}  // namespace
}  // namespace tessera::scene
