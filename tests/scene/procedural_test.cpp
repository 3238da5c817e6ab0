#include "scene/procedural.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>

namespace tessera::scene {
namespace {

void expect_valid(const Scene& scene) {
  for (const Geometry& g : scene.geometries) {
    ASSERT_FALSE(g.indices.empty()) << g.name;
    for (const uint32_t i : g.indices) ASSERT_LT(i, g.vertices.size()) << g.name;
    for (const Vertex& v : g.vertices) {
      ASSERT_NEAR(glm::length(v.normal), 1, 1e-4) << g.name;
      ASSERT_NEAR(glm::length(vec3(v.tangent)), 1, 1e-4) << g.name;
      ASSERT_NEAR(glm::dot(vec3(v.tangent), v.normal), 0, 1e-4) << g.name;
      ASSERT_TRUE(std::isfinite(v.u0) && std::isfinite(v.v0)) << g.name;
    }
    // Shading normals agree with the winding.
    for (size_t i = 0; i < g.indices.size(); i += 3) {
      const Vertex &a = g.vertices[g.indices[i]], &b = g.vertices[g.indices[i + 1]],
                   &c = g.vertices[g.indices[i + 2]];
      const vec3 face = glm::cross(b.position - a.position, c.position - a.position);
      ASSERT_GT(glm::dot(face, a.normal + b.normal + c.normal), 0) << g.name;
    }
  }
  for (const Instance& i : scene.instances) {
    ASSERT_LT(i.geometry, scene.geometries.size());
    ASSERT_LT(i.material, scene.materials.size());
    ASSERT_LT(i.node, scene.nodes.size());
  }
  for (size_t n = 0; n < scene.nodes.size(); ++n) {
    ASSERT_TRUE(scene.nodes[n].parent == kNone || scene.nodes[n].parent < n);
  }
  for (const Texture& t : scene.textures) ASSERT_EQ(t.rgba.size(), size_t{4} * t.width * t.height);
  for (const AnimationChannel& c : scene.animations) {
    ASSERT_EQ(c.values.size(), c.times_s.size() * (c.interpolation == Interpolation::cubic_spline ? 3 : 1));
    ASSERT_LE(c.times_s.back(), scene.animation_length_s);
  }
}

TEST(Gallery, HasTheSizesItPromises) {
  const uint32_t expected[] = {5'000, 30'000, 200'000};
  for (int detail = 0; detail < 3; ++detail) {
    const auto scene = make_gallery(detail);
    expect_valid(*scene);
    EXPECT_GT(scene->triangle_count, 0.8 * expected[detail]);
    EXPECT_LT(scene->triangle_count, 1.25 * expected[detail]);
  }
}

TEST(Gallery, HasTheFeaturesItPromises) {
  const Features f = make_gallery(0)->features;
  EXPECT_TRUE(f.alpha_mask && f.double_sided && f.normal_maps && f.metallic_roughness_maps && f.emissive &&
              f.rigid_animation && f.mirrored_instances);
  EXPECT_FALSE(f.alpha_blend);
  EXPECT_EQ(f.directional_lights, 1u);
  EXPECT_GE(f.point_lights, 6u);
  EXPECT_GE(f.spot_lights, 2u);
  EXPECT_GT(f.most_slanted_triangle, 50);
}

TEST(Gallery, MovesAndReturns) {
  const auto scene = make_gallery(0);
  const auto start = scene->node_transforms(0), later = scene->node_transforms(from_seconds(3));
  const auto again = scene->node_transforms(from_seconds(scene->animation_length_s));
  size_t moved = 0;
  for (size_t n = 0; n < scene->nodes.size(); ++n) {
    EXPECT_EQ(start[n], again[n]);
    moved += start[n] != later[n];
    EXPECT_TRUE(start[n] == later[n] || scene->nodes[n].moves);
  }
  EXPECT_GE(moved, 8u);  // turntables, fans, the cart and its wheels
}

TEST(City, ReachesTheTrianglesAskedFor) {
  for (const uint64_t wanted : {1ull, 50'000ull, 2'000'000ull}) {
    const auto scene = make_city(wanted);
    EXPECT_GE(scene->triangle_count, wanted);
    EXPECT_LE(scene->triangle_count, wanted + 100'000);
    if (wanted < 100'000) expect_valid(*scene);
    EXPECT_EQ(scene->features.instanced_triangles, scene->triangle_count);
    EXPECT_LT(scene->features.unique_triangles, 60'000u);
  }
}

TEST(Paths, AreSmoothWalksInsideTheirScenes) {
  for (const std::string name : {"gallery", "city", "pipe"}) {
    const auto path = load_path(name);
    ASSERT_TRUE(path.ok());
    const Aabb box = (*load_scene(name == "city" ? "city:200000" : name))->world_bounds(0);
    EXPECT_GE(path->duration_ns(), from_seconds(20));
    const std::vector<TimedPose>& poses = path->poses();
    for (size_t i = 0; i < poses.size(); ++i) {
      const dvec3& p = poses[i].pose.position;
      EXPECT_TRUE(p.x > box.min.x && p.x < box.max.x && p.z > box.min.z && p.z < box.max.z && p.y > 1.5 &&
                  p.y < 1.8);
      EXPECT_NEAR(glm::length(poses[i].pose.orientation), 1, 1e-9);
      if (i == 0) continue;
      const double dt = to_seconds(poses[i].time_ns - poses[i - 1].time_ns);
      EXPECT_NEAR(dt, 1 / 60.0, 1e-6);
      EXPECT_LT(glm::distance(p, poses[i - 1].pose.position) / dt, 3);  // m/s
      const double cosine = std::abs(glm::dot(poses[i].pose.orientation, poses[i - 1].pose.orientation));
      EXPECT_LT(2 * std::acos(std::min(cosine, 1.0)) / dt, 2.6);  // rad/s
    }
  }
}

TEST(Pipe, IsMadeOfSlantedTriangles) {
  const auto scene = make_pipe();
  const Geometry& pipe = scene->geometries[scene->instances[0].geometry];
  EXPECT_GT(pipe.triangle_count(), 10u);
  for (uint32_t t = 0; t < pipe.triangle_count(); ++t) {
    const auto corner = [&](uint32_t c) { return pipe.vertices[pipe.indices[3 * t + c]].position; };
    const vec3 a = corner(1) - corner(0), b = corner(2) - corner(0), c = b - a;
    const float longest = std::max({glm::length(a), glm::length(b), glm::length(c)});
    EXPECT_GT(longest * longest / glm::length(glm::cross(a, b)), 50) << "longest edge over height";
  }
}

TEST(Specs, NamesAndErrors) {
  EXPECT_TRUE(load_scene("gallery:0").ok());
  EXPECT_EQ((*load_scene("gallery:0"))->triangle_count, make_gallery(0)->triangle_count);
  for (const char* wrong :
       {"gallery:3", "gallery:", "gallery:-1", "city:x", "city:500000001", "castle", "missing.glb"}) {
    EXPECT_FALSE(load_scene(wrong).ok()) << wrong;
  }
  EXPECT_FALSE(load_path("missing.csv").ok());
}

TEST(Specs, APathBeginsAtZero) {
  const std::string file = testing::TempDir() + "/late_path_" + std::to_string(getpid()) + ".csv";
  std::ofstream(file) << "t_seconds,px,py,pz,qx,qy,qz,qw\n12.5,1,2,3,0,0,0,1\n13,2,2,3,0,0,0,1\n";
  const auto path = load_path(file);
  ASSERT_TRUE(path.ok()) << path.status();
  EXPECT_EQ(path->poses().front().time_ns, 0);
  EXPECT_EQ(path->at(from_seconds(0.25)).position.x, 1.5);
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace tessera::scene
