// Stiff and extreme geometry: coordinates from 1e-40 to 1e7 m, slivers, mirrored and non-uniform scale.
#include <gtest/gtest.h>

#include <cmath>

#include "gltf_builder.h"

namespace tessera::scene {
namespace {

// A bumpy n x n grid of quads, `size` wide, at `offset`, squeezed in y.
GltfBuilder bumpy_grid(int n, float size, float offset, float squeeze = 1) {
  GltfBuilder b;
  std::vector<float> positions, normals;
  std::vector<uint32_t> indices;
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i <= n; ++i) {
      const float x = static_cast<float>(i) / static_cast<float>(n),
                  y = static_cast<float>(j) / static_cast<float>(n);
      positions.insert(positions.end(), {offset + size * x, offset + size * y * squeeze,
                                         offset + 0.02f * size * std::sin(9 * x + 5 * y) * squeeze});
      normals.insert(normals.end(), {0, 0, 1});
    }
  }
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      const auto a = static_cast<uint32_t>(j * (n + 1) + i), b1 = a + 1, c = a + static_cast<uint32_t>(n) + 1,
                 d = c + 1;
      indices.insert(indices.end(), {a, b1, c, d, c, b1});
    }
  }
  b.add_floats(positions, 3);
  b.add_indices(indices);
  b.add_floats(normals, 3);
  b.append("meshes", {{"primitives", {{{"attributes", {{"POSITION", 0}, {"NORMAL", 2}}}, {"indices", 1}}}}});
  b.append("nodes", {{"mesh", 0}});
  return b;
}

struct Outcome {
  uint32_t triangles = 0;
  double pairs = 0;  // share of patches with two triangles
};

Outcome import(const GltfBuilder& file, float max_edge_m = -1) {
  ImportOptions options;
  options.max_edge_m = max_edge_m;
  const auto loaded = load(file, options);
  EXPECT_TRUE(loaded.ok()) << loaded.status();
  if (!loaded.ok()) return {};
  const Scene& scene = **loaded;
  uint32_t pairs = 0, covered = 0;
  for (const Geometry& g : scene.geometries) {
    for (const Patch& p : g.patches) pairs += p.triangle_count == 2, covered += p.triangle_count;
    for (const Vertex& v : g.vertices) EXPECT_NEAR(glm::length(v.normal), 1, 1e-5);
    for (const Meshlet& m : g.meshlets) EXPECT_TRUE(std::isfinite(m.radius));
  }
  EXPECT_EQ(covered, scene.features.unique_triangles);
  EXPECT_TRUE(std::isfinite(scene.features.largest_triangle_m2) &&
              std::isfinite(scene.features.most_slanted_triangle));
  return {scene.triangle_count, static_cast<double>(pairs) / scene.patch_count};
}

TEST(Stability, PatchesDoNotDependOnTheUnitOfLength) {
  for (const float size : {1e-38f, 1e-20f, 1e-7f, 1.f, 1e7f, 1e15f}) {
    const Outcome outcome = import(bumpy_grid(16, size, 0));
    EXPECT_EQ(outcome.triangles, 512u) << size;
    EXPECT_GT(outcome.pairs, 0.9) << size;
  }
}

TEST(Stability, DenormalCoordinates) {
  const Outcome outcome = import(bumpy_grid(4, 1e-40f, 0));
  EXPECT_GT(outcome.triangles, 0u);
  EXPECT_LE(outcome.triangles, 32u);
}

TEST(Stability, FarFromTheOrigin) {
  const Outcome outcome = import(bumpy_grid(16, 1024, 1e7f));  // floats are 1 m apart there
  EXPECT_GT(outcome.triangles, 500u);
  EXPECT_GT(outcome.pairs, 0.8);
}

TEST(Stability, SliversToAspect1e7) {
  for (const float squeeze : {1e-3f, 1e-5f, 1e-7f}) {
    const Outcome outcome = import(bumpy_grid(16, 1, 0, squeeze));
    EXPECT_EQ(outcome.triangles, 512u) << squeeze;
    EXPECT_GT(outcome.pairs, 0.9) << squeeze;
  }
}

// A halving leaves three of a sliver, four of other triangles; seven halvings bring 100 m below 1 m.
TEST(Stability, SplitSlivers) {
  const Outcome outcome = import(bumpy_grid(1, 100, 0, 1e-7f), 1);
  EXPECT_GE(outcome.triangles, 2u * 128);
  EXPECT_LE(outcome.triangles, 2u * 2187);
}

TEST(Stability, MirroredAndNonUniformScale) {
  GltfBuilder file = bumpy_grid(8, 1, 0);
  file.document["nodes"][0]["scale"] = {-1, 1e-5, 1e5};
  file.append("nodes", {{"mesh", 0}, {"scale", {20, 0.001, 1}}});
  EXPECT_EQ(import(file).triangles, 256u);
  // Splitting measures world lengths: x by 20 m, y by at most a metre.
  file.document["nodes"][0]["scale"] = {-1, 1, 1};
  const Outcome split = import(file, 1);
  EXPECT_GE(split.triangles, 256u * 3);
  EXPECT_LE(split.triangles, 256u * 9);
}

TEST(Stability, FlatInstancesAreLeftOut) {
  GltfBuilder file = bumpy_grid(8, 1, 0);
  file.append("nodes", {{"mesh", 0}, {"scale", {1, 0, 1}}});
  EXPECT_EQ(import(file).triangles, 128u);
}

TEST(Stability, LargeCoordinatesEndTheAutomaticSplit) {
  EXPECT_GT(import(bumpy_grid(2, 1e25f, 0), 0).triangles, 0u);
}

// Hundreds of triangles on one edge and on one vertex.
TEST(Stability, NonManifold) {
  GltfBuilder b;
  std::vector<float> positions = {0, 0, 0, 0, 0, 1};
  std::vector<uint32_t> indices;
  for (uint32_t i = 0; i < 300; ++i) {
    const float a = 0.02f * static_cast<float>(i);
    positions.insert(positions.end(), {std::cos(a), std::sin(a), 0.5f});
    indices.insert(indices.end(), {0, 1, 2 + i});
    indices.insert(indices.end(), {1, 0, 2 + i});
  }
  b.add_floats(positions, 3);
  b.add_indices(indices);
  b.append("meshes", {{"primitives", {{{"attributes", {{"POSITION", 0}}}, {"indices", 1}}}}});
  b.append("nodes", {{"mesh", 0}});
  EXPECT_EQ(import(b).triangles, 600u);
}

}  // namespace
}  // namespace tessera::scene
