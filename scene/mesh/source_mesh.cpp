#include "scene/mesh/source_mesh.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <array>

namespace tessera::scene {
namespace {

// A triangle lower than this share of its longest edge is a line: positions are floats, so nothing real is
// that thin.
constexpr double kMinHeight = 1e-12;

// Twice the area vector, in double: exact enough for slivers, and denormal positions do not vanish.
dvec3 area_vector(const std::vector<Vertex>& vertices, const uint32_t* t) {
  const dvec3 a(vertices[t[0]].position);
  return glm::cross(dvec3(vertices[t[1]].position) - a, dvec3(vertices[t[2]].position) - a);
}

bool is_degenerate(const std::vector<Vertex>& vertices, const uint32_t* t) {
  if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) return true;
  double longest2 = 0;
  for (int k = 0; k < 3; ++k) {
    const dvec3 e = dvec3(vertices[t[k]].position) - dvec3(vertices[t[(k + 1) % 3]].position);
    longest2 = std::max(longest2, glm::dot(e, e));
  }
  return !(glm::length(area_vector(vertices, t)) > kMinHeight * longest2);
}

vec3 unit_or(const dvec3& v, const vec3& otherwise) {
  const double length = glm::length(v);
  return length > 0 ? vec3(v / length) : otherwise;
}

}  // namespace

size_t drop_degenerate_triangles(SourceMesh& mesh) {
  size_t kept = 0;
  for (size_t i = 0; i < mesh.indices.size(); i += 3) {
    if (is_degenerate(mesh.vertices, &mesh.indices[i])) continue;
    std::copy_n(mesh.indices.begin() + static_cast<ptrdiff_t>(i), 3,
                mesh.indices.begin() + static_cast<ptrdiff_t>(kept));
    kept += 3;
  }
  const size_t dropped = (mesh.indices.size() - kept) / 3;
  mesh.indices.resize(kept);
  return dropped;
}

void set_flat_normals(SourceMesh& mesh) {
  std::vector<Vertex> vertices;
  vertices.reserve(mesh.indices.size());
  for (size_t i = 0; i < mesh.indices.size(); i += 3) {
    const vec3 normal = unit_or(area_vector(mesh.vertices, &mesh.indices[i]), vec3(0, 1, 0));
    for (size_t k = i; k < i + 3; ++k) {
      vertices.push_back(mesh.vertices[mesh.indices[k]]);
      vertices.back().normal = normal;
      mesh.indices[k] = static_cast<uint32_t>(k);
    }
  }
  mesh.vertices = std::move(vertices);
}

void repair_normals(SourceMesh& mesh) {
  for (size_t i = 0; i < mesh.indices.size(); ++i) {
    Vertex& v = mesh.vertices[mesh.indices[i]];
    if (v.normal != vec3(0)) continue;
    v.normal = unit_or(area_vector(mesh.vertices, &mesh.indices[i - i % 3]), vec3(0, 1, 0));
  }
  for (Vertex& v : mesh.vertices) v.normal = unit_or(dvec3(v.normal), vec3(0, 1, 0));
}

void weld_vertices(SourceMesh& mesh) {
  if (mesh.indices.empty()) return;
  std::vector<uint32_t> remap(mesh.vertices.size());
  const size_t count =
      meshopt_generateVertexRemap(remap.data(), mesh.indices.data(), mesh.indices.size(),
                                  mesh.vertices.data(), mesh.vertices.size(), sizeof(Vertex));
  std::vector<Vertex> vertices(count);
  meshopt_remapVertexBuffer(vertices.data(), mesh.vertices.data(), mesh.vertices.size(), sizeof(Vertex),
                            remap.data());
  for (uint32_t& index : mesh.indices) index = remap[index];
  mesh.vertices = std::move(vertices);
}

}  // namespace tessera::scene
