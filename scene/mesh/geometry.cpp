// build_geometry(): pairs of triangles, meshlets of them by meshoptimizer, everything in the order of use.
#include <meshoptimizer.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>

#include "scene/mesh/patches.h"
#include "scene/mesh/source_mesh.h"

namespace tessera::scene {
namespace {

constexpr size_t kMeshletVertices = 255;  // meshoptimizer's limit: seams shall not make meshlets small

Aabb bounds_of(const std::vector<Vertex>& vertices) {
  Aabb box;
  for (const Vertex& v : vertices) box.add(v.position);
  return box;
}

// Positions in world proportions, moved to the origin and scaled to about 1: clustering and patches work
// alike for coordinates of 1e7 and 1e-7.
std::vector<PatchVertex> proportioned(const SourceMesh& mesh) {
  const Aabb box = bounds_of(mesh.vertices);
  const dvec3 extent = mesh.scale * (dvec3(box.max) - dvec3(box.min));
  const double longest = std::max({extent.x, extent.y, extent.z});
  const dvec3 scale = std::isfinite(longest) && longest > 0 ? mesh.scale / longest : dvec3(1);
  std::vector<PatchVertex> result;
  result.reserve(mesh.vertices.size());
  for (const Vertex& v : mesh.vertices) {
    result.push_back({scale * (dvec3(v.position) - dvec3(box.min)), glm::dvec2(v.u0, v.v0)});
  }
  return result;
}

struct CornersHash {
  size_t operator()(const std::array<uint32_t, 3>& t) const {
    return (t[0] * 0x9E3779B97F4A7C15ull ^ t[1]) * 0xC2B2AE3D27D4EB4Full ^ (uint64_t{t[2]} << 20);
  }
};

// Clusters of representatives (patches.h). meshoptimizer sees one triangle of each pair and half of the
// limit, so that pairs stay together.
std::vector<std::vector<uint32_t>> make_clusters(const SourceMesh& mesh,
                                                 const std::vector<PatchVertex>& vertices,
                                                 const std::vector<uint32_t>& representatives) {
  constexpr size_t kPairs = kMeshletTriangles / 2 / 4 * 4;  // the library wants a multiple of 4
  std::vector<vec3> positions;
  positions.reserve(vertices.size());
  for (const PatchVertex& v : vertices) positions.push_back(vec3(v.position));
  std::vector<uint32_t> indices;
  std::unordered_multimap<std::array<uint32_t, 3>, uint32_t, CornersHash> by_corners(representatives.size());
  for (const uint32_t t : representatives) {
    const uint32_t* corners = &mesh.indices[size_t{3} * t];
    indices.insert(indices.end(), corners, corners + 3);
    by_corners.insert({{corners[0], corners[1], corners[2]}, t});
  }
  const size_t bound = meshopt_buildMeshletsBound(indices.size(), kMeshletVertices, kPairs);
  std::vector<meshopt_Meshlet> meshlets(bound);
  std::vector<unsigned int> meshlet_vertices(bound * kMeshletVertices);
  std::vector<unsigned char> meshlet_triangles(bound * kPairs * 3);
  meshlets.resize(meshopt_buildMeshlets(meshlets.data(), meshlet_vertices.data(), meshlet_triangles.data(),
                                        indices.data(), indices.size(), &positions[0].x, positions.size(),
                                        sizeof(vec3), kMeshletVertices, kPairs, /*cone_weight=*/0));
  std::vector<std::vector<uint32_t>> clusters;
  for (const meshopt_Meshlet& m : meshlets) {
    std::vector<uint32_t>& cluster = clusters.emplace_back();
    for (size_t i = 0; i < m.triangle_count; ++i) {
      std::array<uint32_t, 3> corners;
      for (size_t k = 0; k < 3; ++k) {
        corners[k] = meshlet_vertices[m.vertex_offset + meshlet_triangles[m.triangle_offset + 3 * i + k]];
      }
      const auto found = by_corners.find(corners);
      cluster.push_back(found->second);
      by_corners.erase(found);
    }
  }
  return clusters;
}

void add_patches(std::span<const PatchTriangles> patches, Geometry& geometry) {
  for (const PatchTriangles& patch : patches) {
    geometry.patches.push_back({geometry.triangle_count(), patch.count});
    for (uint32_t t = 0; t < patch.count; ++t) {
      geometry.indices.insert(geometry.indices.end(), patch.triangles[t].begin(), patch.triangles[t].end());
    }
  }
}

// Vertices in the order of their first use; those never used are left out.
std::vector<Vertex> in_order_of_use(const std::vector<Vertex>& vertices, std::vector<uint32_t>& indices) {
  std::vector<uint32_t> remap(vertices.size(), kNone);
  std::vector<Vertex> ordered;
  for (uint32_t& index : indices) {
    if (remap[index] == kNone) {
      remap[index] = static_cast<uint32_t>(ordered.size());
      ordered.push_back(vertices[index]);
    }
    index = remap[index];
  }
  return ordered;
}

// Around the centre of the box, in double: right at any magnitude.
void set_sphere(const Geometry& geometry, Meshlet& meshlet) {
  const auto first = geometry.indices.begin() + 3 * static_cast<ptrdiff_t>(meshlet.first_triangle);
  const std::span<const uint32_t> indices(first, first + 3 * static_cast<ptrdiff_t>(meshlet.triangle_count));
  dvec3 low(INFINITY), high(-INFINITY);
  for (const uint32_t i : indices) {
    low = glm::min(low, dvec3(geometry.vertices[i].position));
    high = glm::max(high, dvec3(geometry.vertices[i].position));
  }
  meshlet.center = vec3(0.5 * (low + high));
  double radius = 0;
  for (const uint32_t i : indices) {
    radius = std::max(radius, glm::distance(dvec3(geometry.vertices[i].position), dvec3(meshlet.center)));
  }
  meshlet.radius = std::nextafter(static_cast<float>(radius), INFINITY);
}

}  // namespace

Geometry build_geometry(SourceMesh mesh) {
  Geometry geometry;
  geometry.name = std::move(mesh.name);
  if (mesh.indices.empty()) return geometry;
  const std::vector<PatchVertex> vertices = proportioned(mesh);
  geometry.indices.reserve(mesh.indices.size());
  PatchMaker maker(mesh.indices, vertices);
  for (const std::vector<uint32_t>& cluster : make_clusters(mesh, vertices, maker.representatives())) {
    const auto first_patch = static_cast<uint32_t>(geometry.patches.size());
    const uint32_t first_triangle = geometry.triangle_count();
    add_patches(maker.make_patches(cluster), geometry);
    geometry.meshlets.push_back({first_triangle, geometry.triangle_count() - first_triangle, first_patch,
                                 static_cast<uint32_t>(geometry.patches.size()) - first_patch, vec3(0), 0});
  }
  geometry.vertices = in_order_of_use(mesh.vertices, geometry.indices);
  geometry.bounds = bounds_of(geometry.vertices);
  for (Meshlet& meshlet : geometry.meshlets) set_sphere(geometry, meshlet);
  return geometry;
}

}  // namespace tessera::scene
