// Splitting, meshlets and patches, on meshes made here.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <set>

#include "scene/mesh/source_mesh.h"

namespace tessera::scene {
namespace {

Vertex vertex_at(const vec3& position, const vec2& uv = vec2(0)) {
  Vertex v{};
  v.position = position;
  v.u0 = uv.x;
  v.v0 = uv.y;
  v.normal = vec3(0, 0, 1);
  v.tangent = vec4(1, 0, 0, 1);
  v.color = 0xffffffffu;
  return v;
}

SourceMesh grid(uint32_t columns, uint32_t rows, float width, float height) {
  SourceMesh mesh;
  for (uint32_t j = 0; j <= rows; ++j) {
    for (uint32_t i = 0; i <= columns; ++i) {
      const vec2 uv(static_cast<float>(i) / static_cast<float>(columns),
                    static_cast<float>(j) / static_cast<float>(rows));
      mesh.vertices.push_back(vertex_at(vec3(uv.x * width, uv.y * height, 0), uv));
    }
  }
  for (uint32_t j = 0; j < rows; ++j) {
    for (uint32_t i = 0; i < columns; ++i) {
      const uint32_t a = j * (columns + 1) + i, b = a + 1, c = a + columns + 1, d = c + 1;
      mesh.indices.insert(mesh.indices.end(), {a, b, c, d, c, b});
    }
  }
  return mesh;
}

// Triangles with random corners that share many of their edges, and seams: some vertices are doubled with
// other uvs.
SourceMesh random_mesh(uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> shift(-0.4f, 0.4f), size(0.3f, 40);
  SourceMesh mesh = grid(1 + random() % 9, 1 + random() % 9, size(random), size(random));
  for (Vertex& v : mesh.vertices) v.position += vec3(shift(random), shift(random), 3 * shift(random));
  for (uint32_t& index : mesh.indices) {
    if (random() % 4 != 0) continue;
    Vertex twin = mesh.vertices[index];
    twin.u0 += 0.5f;
    mesh.vertices.push_back(twin);
    index = static_cast<uint32_t>(mesh.vertices.size() - 1);
  }
  return mesh;
}

using Key = std::array<float, 3>;
Key key_of(const vec3& p) {
  return {p.x, p.y, p.z};
}

double area_of(const std::vector<Vertex>& vertices, const std::vector<uint32_t>& indices) {
  double area = 0;
  for (size_t i = 0; i < indices.size(); i += 3) {
    const dvec3 a(vertices[indices[i]].position), b(vertices[indices[i + 1]].position),
        c(vertices[indices[i + 2]].position);
    area += 0.5 * glm::length(glm::cross(b - a, c - a));
  }
  return area;
}

// Edges by position that have a triangle on one side only.
std::vector<std::pair<Key, Key>> boundary(const SourceMesh& mesh) {
  std::map<std::pair<Key, Key>, int> count;
  for (size_t i = 0; i < mesh.indices.size(); ++i) {
    const Key a = key_of(mesh.vertices[mesh.indices[i]].position);
    const Key b = key_of(mesh.vertices[mesh.indices[i - i % 3 + (i + 1) % 3]].position);
    ++count[std::minmax(a, b)];
  }
  std::vector<std::pair<Key, Key>> edges;
  for (const auto& [edge, n] : count) {
    if (n == 1) edges.push_back(edge);
  }
  return edges;
}

double length_of(const std::pair<Key, Key>& edge) {
  return std::hypot(double(edge.first[0]) - edge.second[0], double(edge.first[1]) - edge.second[1],
                    double(edge.first[2]) - edge.second[2]);
}

TEST(Split, KeepsAreaAndBoundaryAndEndsBelowTheLimit) {
  for (uint32_t seed = 0; seed < 60; ++seed) {
    SourceMesh mesh = random_mesh(seed);
    mesh.scale = dvec3(1, 2, 0.5);
    const double area = area_of(mesh.vertices, mesh.indices);
    double border = 0;
    for (const auto& edge : boundary(mesh)) border += length_of(edge);
    const uint64_t predicted = count_after_split(mesh, 0.9, 1'000'000'000);
    split_long_edges(mesh, 0.9);
    EXPECT_EQ(mesh.triangle_count(), predicted);
    EXPECT_NEAR(area_of(mesh.vertices, mesh.indices), area, 1e-5 * area);
    // A T-junction would leave edges with one triangle inside the mesh, and a longer boundary.
    double border_after = 0;
    for (const auto& edge : boundary(mesh)) border_after += length_of(edge);
    EXPECT_NEAR(border_after, border, 1e-5 * border) << "seed " << seed;
    for (size_t i = 0; i < mesh.indices.size(); ++i) {
      const dvec3 a(mesh.vertices[mesh.indices[i]].position),
          b(mesh.vertices[mesh.indices[i - i % 3 + (i + 1) % 3]].position);
      EXPECT_LE(glm::length(mesh.scale * (a - b)), 0.9);
    }
  }
}

TEST(Split, InterpolatesAttributesAndSharesNewVertices) {
  SourceMesh mesh = grid(1, 1, 8, 8);
  split_long_edges(mesh, 1.5);  // diagonals of 1.41 stay: 64 squares
  EXPECT_EQ(mesh.triangle_count(), 128u);
  EXPECT_EQ(mesh.vertices.size(), 81u);
  for (const Vertex& v : mesh.vertices) {
    EXPECT_EQ(vec2(v.u0, v.v0), vec2(v.position) / 8.f);
    EXPECT_EQ(v.normal, vec3(0, 0, 1));
    EXPECT_EQ(v.color, 0xffffffffu);
  }
}

TEST(Split, CountStopsAtItsLimit) {
  const SourceMesh mesh = grid(1, 1, 1e7f, 1e7f);
  EXPECT_LE(count_after_split(mesh, 0.01, 5000), 5001u);
}

TEST(Split, EndsWhereFloatsEnd) {
  SourceMesh mesh = grid(1, 1, 1, 1);
  for (Vertex& v : mesh.vertices) v.position += vec3(1e7f, 0, 0);  // one float apart in x
  split_long_edges(mesh, 1e-3);
  EXPECT_GT(mesh.triangle_count(), 1000u);
  EXPECT_LT(mesh.triangle_count(), 10'000u);
}

TEST(Split, AutomaticEdgeGrowsTheSceneWithinItsBudget) {
  const SourceMesh wall = grid(1, 1, 100, 100);
  const std::vector<SourceMesh> once = {wall}, none = {grid(10, 10, 0.1f, 0.1f)};
  const double edge = choose_max_edge(once, std::array<uint64_t, 1>{1});
  EXPECT_LE(count_after_split(wall, edge, 1'000'000'000), 100'002u);
  EXPECT_GT(count_after_split(wall, edge / 1.5, 1'000'000'000), 100'002u);
  const double edge_of_many = choose_max_edge(once, std::array<uint64_t, 1>{1000});
  EXPECT_GT(edge_of_many, 4 * edge);
  EXPECT_EQ(choose_max_edge(none, std::array<uint64_t, 1>{1}), 0.35);
}

// Else a file of a few hundred bytes could take minutes: found by fuzzing.
TEST(Split, AutomaticEdgeOfAHugeSceneIsThatOfASmallOneScaled) {
  std::vector<SourceMesh> wall = {grid(1, 1, 100, 100)};
  const double edge = choose_max_edge(wall, std::array<uint64_t, 1>{1});
  wall[0].scale = dvec3(std::ldexp(1.0, 500));
  EXPECT_EQ(choose_max_edge(wall, std::array<uint64_t, 1>{1}), std::ldexp(edge, 500));
}

struct Shares {
  std::array<uint32_t, 4> patches{};
  uint32_t all() const { return patches[1] + patches[2] + patches[3]; }
};

Shares shares_of(const Geometry& g) {
  Shares shares;
  for (const Patch& p : g.patches) ++shares.patches[p.triangle_count];
  return shares;
}

// Triangles as rotated so that the smallest key comes first: equal if they are the same with the same
// winding.
std::multiset<std::array<Key, 3>> triangles_of(const std::vector<Vertex>& vertices,
                                               const std::vector<uint32_t>& indices) {
  std::multiset<std::array<Key, 3>> all;
  for (size_t i = 0; i < indices.size(); i += 3) {
    std::array<Key, 3> t;
    for (size_t k = 0; k < 3; ++k) t[k] = key_of(vertices[indices[i + k]].position);
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    all.insert(t);
  }
  return all;
}

// Corners of one patch that share a vertex must share their place in the block, and the other way round.
void expect_corners_fit(const Geometry& g, const Patch& patch) {
  std::map<uint32_t, std::pair<float, float>> place;
  for (uint32_t t = 0; t < patch.triangle_count; ++t) {
    for (uint32_t k = 0; k < 3; ++k) {
      const vec2 corner = patch_corner(patch.triangle_count, t, k);
      const auto [found, is_new] =
          place.try_emplace(g.indices[3 * (patch.first_triangle + t) + k], corner.x, corner.y);
      if (!is_new) {
        EXPECT_EQ(found->second, std::pair(corner.x, corner.y));
      }
    }
  }
  EXPECT_EQ(place.size(), patch.triangle_count + 2);
}

void expect_sound(const SourceMesh& source, const Geometry& g) {
  EXPECT_EQ(triangles_of(source.vertices, source.indices), triangles_of(g.vertices, g.indices));
  uint32_t triangle = 0, patch = 0;
  for (const Meshlet& m : g.meshlets) {
    EXPECT_EQ(m.first_triangle, triangle);
    EXPECT_EQ(m.first_patch, patch);
    EXPECT_LE(m.triangle_count, kMeshletTriangles);
    for (uint32_t p = 0; p < m.patch_count; ++p, ++patch) {
      EXPECT_EQ(g.patches[patch].first_triangle, triangle);
      expect_corners_fit(g, g.patches[patch]);
      triangle += g.patches[patch].triangle_count;
    }
    EXPECT_EQ(triangle, m.first_triangle + m.triangle_count);
    for (uint32_t i = 3 * m.first_triangle; i < 3 * triangle; ++i) {
      EXPECT_LE(glm::distance(dvec3(m.center), dvec3(g.vertices[g.indices[i]].position)), double(m.radius));
    }
  }
  EXPECT_EQ(triangle, g.triangle_count());
  EXPECT_EQ(patch, g.patches.size());
}

TEST(Patches, CornersTileTheBlock) {
  for (uint32_t count = 1; count <= 3; ++count) {
    double area = 0;
    for (uint32_t t = 0; t < count; ++t) {
      const vec2 a = patch_corner(count, t, 0), b = patch_corner(count, t, 1), c = patch_corner(count, t, 2);
      const double twice = double(b.x - a.x) * double(c.y - a.y) - double(b.y - a.y) * double(c.x - a.x);
      EXPECT_GT(twice, 0) << "all wind alike";
      area += 0.5 * twice;
    }
    EXPECT_DOUBLE_EQ(area, count == 1 ? 0.5 : 1);
  }
}

TEST(Patches, CoverEachTriangleOnceWithItsWinding) {
  for (uint32_t seed = 0; seed < 60; ++seed) {
    SourceMesh mesh = random_mesh(seed);
    if (seed % 2) split_long_edges(mesh, 1.3);
    drop_degenerate_triangles(mesh);
    const SourceMesh source = mesh;
    expect_sound(source, build_geometry(mesh));
  }
}

TEST(Patches, GridBecomesItsQuads) {
  const SourceMesh mesh = grid(40, 40, 10, 10);
  const Geometry g = build_geometry(mesh);
  expect_sound(mesh, g);
  const Shares shares = shares_of(g);
  EXPECT_GE(shares.patches[2], 0.97 * shares.all());
  uint32_t squares = 0;
  for (const Patch& p : g.patches) {
    if (p.triangle_count != 2) continue;
    const auto at = [&](uint32_t k) { return g.vertices[g.indices[3 * p.first_triangle + k]].position; };
    squares += std::abs(glm::dot(at(1) - at(0), at(2) - at(0))) < 1e-6f;
  }
  EXPECT_GE(squares, 0.95 * shares.all());
}

TEST(Patches, FewStayAloneOnIrregularSurfaces) {
  SourceMesh sphere;  // an octahedron, split to 2048 triangles
  for (const vec3& p :
       {vec3(1, 0, 0), vec3(-1, 0, 0), vec3(0, 1, 0), vec3(0, -1, 0), vec3(0, 0, 1), vec3(0, 0, -1)}) {
    sphere.vertices.push_back(vertex_at(p));
  }
  sphere.indices = {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};
  split_long_edges(sphere, 0.1);
  for (Vertex& v : sphere.vertices) v.position = glm::normalize(v.position);
  const Geometry g = build_geometry(sphere);
  expect_sound(sphere, g);
  EXPECT_LE(shares_of(g).patches[1], 0.03 * shares_of(g).all());
}

TEST(Patches, OppositeWindingAndSharpFoldsStayApart) {
  SourceMesh flipped = grid(1, 1, 1, 1);
  std::swap(flipped.indices[3], flipped.indices[4]);
  EXPECT_EQ(build_geometry(flipped).patches.size(), 2u);
  SourceMesh folded = grid(1, 1, 1, 1);
  folded.vertices[3].position = vec3(0.3f, 0.3f, 0.7f);
  EXPECT_EQ(build_geometry(folded).patches.size(), 2u);
}

TEST(Weld, JoinsEqualVerticesOnly) {
  SourceMesh mesh = grid(2, 1, 1, 1);
  set_flat_normals(mesh);
  EXPECT_EQ(mesh.vertices.size(), 12u);
  weld_vertices(mesh);
  EXPECT_EQ(mesh.vertices.size(), 6u);
  mesh.vertices[0].u0 += 1;
  weld_vertices(mesh);
  EXPECT_EQ(mesh.vertices.size(), 6u);
}

}  // namespace
}  // namespace tessera::scene
