// build_geometry(): meshlets by meshoptimizer, patches inside each, everything in the order of use.
#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>

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

// Positions in world proportions, moved to the origin and scaled to about 1: clustering and patches work alike for
// coordinates of 1e7 and 1e-7.
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

// Triangles of each meshlet as vertex indices of the mesh.
std::vector<std::vector<uint32_t>> make_meshlets(const SourceMesh& mesh, const std::vector<PatchVertex>& vertices) {
  std::vector<vec3> positions;
  positions.reserve(vertices.size());
  for (const PatchVertex& v : vertices) positions.push_back(vec3(v.position));
  const size_t bound = meshopt_buildMeshletsBound(mesh.indices.size(), kMeshletVertices, kMeshletTriangles);
  std::vector<meshopt_Meshlet> meshlets(bound);
  std::vector<unsigned int> meshlet_vertices(bound * kMeshletVertices);
  std::vector<unsigned char> meshlet_triangles(bound * kMeshletTriangles * 3);
  const size_t count = meshopt_buildMeshlets(meshlets.data(), meshlet_vertices.data(), meshlet_triangles.data(),
                                             mesh.indices.data(), mesh.indices.size(), &positions[0].x, positions.size(),
                                             sizeof(vec3), kMeshletVertices, kMeshletTriangles, /*cone_weight=*/0);
  std::vector<std::vector<uint32_t>> result(count);
  for (size_t m = 0; m < count; ++m) {
    for (size_t i = 0; i < meshlets[m].triangle_count * 3; ++i) {
      const unsigned char local = meshlet_triangles[meshlets[m].triangle_offset + i];
      result[m].push_back(meshlet_vertices[meshlets[m].vertex_offset + local]);
    }
  }
  return result;
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
  for (const std::vector<uint32_t>& indices : make_meshlets(mesh, vertices)) {
    const auto first_patch = static_cast<uint32_t>(geometry.patches.size());
    const uint32_t first_triangle = geometry.triangle_count();
    add_patches(make_patches(indices, vertices), geometry);
    geometry.meshlets.push_back({first_triangle, geometry.triangle_count() - first_triangle, first_patch,
                                 static_cast<uint32_t>(geometry.patches.size()) - first_patch, vec3(0), 0});
  }
  geometry.vertices = in_order_of_use(mesh.vertices, geometry.indices);
  geometry.bounds = bounds_of(geometry.vertices);
  for (Meshlet& meshlet : geometry.meshlets) set_sphere(geometry, meshlet);
  return geometry;
}

}  // namespace tessera::scene
