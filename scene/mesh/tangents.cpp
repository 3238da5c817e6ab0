// Tangents from texture coordinates, in the manner of MikkTSpace: angle-weighted, one frame a handedness.
#include <cmath>

#include "scene/mesh/source_mesh.h"

namespace tessera::scene {
namespace {

struct Frame {
  dvec3 along_u{0};
  double handedness = 0;  // 0 = the texture coordinates of this triangle have no area
};

glm::dvec2 mapped_uv(const Vertex& v, const TextureRef& map) {
  const glm::dvec2 t = map.texcoord == 1 ? glm::dvec2(v.uv1) : glm::dvec2(v.u0, v.v0);
  const auto& m = map.uv_from_texcoord;
  return glm::dvec2(m[0]) * t.x + glm::dvec2(m[1]) * t.y + glm::dvec2(m[2]);
}

Frame triangle_frame(const SourceMesh& mesh, const uint32_t* t, const TextureRef& map) {
  const Vertex &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
  const dvec3 e1 = dvec3(b.position) - dvec3(a.position), e2 = dvec3(c.position) - dvec3(a.position);
  const glm::dvec2 d1 = mapped_uv(b, map) - mapped_uv(a, map), d2 = mapped_uv(c, map) - mapped_uv(a, map);
  const double area = d1.x * d2.y - d1.y * d2.x;
  const dvec3 du = (area < 0 ? -1.0 : 1.0) * (d2.y * e1 - d1.y * e2);  // along dP/du
  const double length = glm::length(du);
  if (area == 0 || !(length > 0)) return {};
  // v runs down while the bitangent points up: a positive uv area is a mirrored frame.
  return {du / length, area < 0 ? 1.0 : -1.0};
}

double corner_angle(const SourceMesh& mesh, const uint32_t* t, int k) {
  const dvec3 p(mesh.vertices[t[k]].position);
  const dvec3 a = dvec3(mesh.vertices[t[(k + 1) % 3]].position) - p;
  const dvec3 b = dvec3(mesh.vertices[t[(k + 2) % 3]].position) - p;
  return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
}

// Any unit vector orthogonal to n.
dvec3 orthogonal(const dvec3& n) {
  const dvec3 axis = std::abs(n.x) < 0.6 ? dvec3(1, 0, 0) : dvec3(0, 1, 0);
  return glm::normalize(axis - n * glm::dot(axis, n));
}

vec4 finish(const dvec3& normal, const dvec3& sum, double handedness) {
  const dvec3 t = sum - normal * glm::dot(normal, sum);
  const double length = glm::length(t);
  return vec4(vec3(length > 1e-12 ? t / length : orthogonal(normal)), handedness < 0 ? -1.f : 1.f);
}

// Gives corners of the other handedness a copy of their vertex. After it a vertex has one handedness.
std::vector<double> part_by_handedness(SourceMesh& mesh, const std::vector<Frame>& frames) {
  std::vector<double> handedness(mesh.vertices.size(), 0.0);
  std::vector<uint32_t> twin(mesh.vertices.size(), kNone);
  for (size_t i = 0; i < mesh.indices.size(); ++i) {
    const uint32_t v = mesh.indices[i];
    const double h = frames[i / 3].handedness;
    if (h == 0 || handedness[v] == h) continue;
    if (handedness[v] == 0) {
      handedness[v] = h;
      continue;
    }
    if (twin[v] == kNone) {
      twin[v] = static_cast<uint32_t>(mesh.vertices.size());
      mesh.vertices.push_back(Vertex(mesh.vertices[v]));
      handedness.push_back(h);
      twin.push_back(kNone);
    }
    mesh.indices[i] = twin[v];
  }
  return handedness;
}

}  // namespace

void derive_tangents(SourceMesh& mesh, const TextureRef& normal_map) {
  std::vector<Frame> frames(mesh.triangle_count());
  for (size_t t = 0; t < frames.size(); ++t)
    frames[t] = triangle_frame(mesh, &mesh.indices[3 * t], normal_map);
  const std::vector<double> handedness = part_by_handedness(mesh, frames);
  std::vector<dvec3> sums(mesh.vertices.size(), dvec3(0));
  for (size_t i = 0; i < mesh.indices.size(); ++i) {
    const uint32_t v = mesh.indices[i];
    const dvec3 n(mesh.vertices[v].normal);
    const dvec3 projected = frames[i / 3].along_u - n * glm::dot(n, frames[i / 3].along_u);
    const double length = glm::length(projected);
    if (length > 1e-12) {
      sums[v] += projected / length * corner_angle(mesh, &mesh.indices[i - i % 3], static_cast<int>(i % 3));
    }
  }
  for (size_t v = 0; v < mesh.vertices.size(); ++v) {
    mesh.vertices[v].tangent = finish(dvec3(mesh.vertices[v].normal), sums[v], handedness[v]);
  }
}

}  // namespace tessera::scene
