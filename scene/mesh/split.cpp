#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>

#include "scene/mesh/source_mesh.h"

namespace tessera::scene {
namespace {

template <typename Corner>
using Triangle = std::array<Corner, 3>;

// Equal bits for (p, q) and (q, p); halves first, so that large coordinates do not overflow.
vec3 midpoint(const vec3& p, const vec3& q) {
  return 0.5f * p + 0.5f * q;
}

class EdgeRule {
 public:
  EdgeRule(const dvec3& scale, double max_edge_m) : scale_(scale), max2_(max_edge_m * max_edge_m) {}

  double length2(const vec3& p, const vec3& q) const {
    const dvec3 d = scale_ * (dvec3(p) - dvec3(q));
    return d.x * d.x + d.y * d.y + d.z * d.z;
  }

  bool splits(const vec3& p, const vec3& q) const {
    const double whole2 = length2(p, q);
    if (whole2 <= max2_) return false;
    // At the resolution of floats the midpoint may fall to one end; both parts must get shorter, so that it
    // all ends.
    const vec3 m = midpoint(p, q);
    return std::max(length2(p, m), length2(m, q)) < kShorter2 * whole2;
  }

 private:
  static constexpr double kShorter2 = 0.75 * 0.75;
  dvec3 scale_;
  double max2_;
};

// `root` and what becomes of it: each flagged edge is split at once, so the neighbour over it, which flags it
// too, meets the same vertices. `emit` returns false to stop.
template <typename Corner, typename Position, typename Midpoint, typename Emit>
bool split_triangle(const Triangle<Corner>& root, const EdgeRule& rule, Position position, Midpoint mid,
                    Emit emit, std::vector<Triangle<Corner>>& stack) {
  stack.assign(1, root);
  while (!stack.empty()) {
    Triangle<Corner> t = stack.back();
    stack.pop_back();
    std::array<bool, 3> cut;
    for (int k = 0; k < 3; ++k) cut[k] = rule.splits(position(t[k]), position(t[(k + 1) % 3]));
    const int cuts = cut[0] + cut[1] + cut[2];
    if (cuts == 0) {
      if (!emit(t)) return false;
      continue;
    }
    // Turn it so that edge 0 is cut, and with two cuts also edge 1.
    const int first = cuts == 1   ? (cut[0]   ? 0
                                     : cut[1] ? 1
                                              : 2)
                      : cuts == 2 ? (!cut[0]   ? 1
                                     : !cut[1] ? 2
                                               : 0)
                                  : 0;
    t = {t[first], t[(first + 1) % 3], t[(first + 2) % 3]};
    const Corner m0 = mid(t[0], t[1]);
    if (cuts == 1) {
      stack.push_back({t[0], m0, t[2]});
      stack.push_back({m0, t[1], t[2]});
      continue;
    }
    const Corner m1 = mid(t[1], t[2]);
    stack.push_back({m0, t[1], m1});
    if (cuts == 2) {
      if (rule.length2(position(t[0]), position(m1)) <= rule.length2(position(m0), position(t[2]))) {
        stack.push_back({t[0], m0, m1});
        stack.push_back({t[0], m1, t[2]});
      } else {
        stack.push_back({t[0], m0, t[2]});
        stack.push_back({m0, m1, t[2]});
      }
      continue;
    }
    const Corner m2 = mid(t[2], t[0]);
    stack.push_back({t[0], m0, m2});
    stack.push_back({m2, m1, t[2]});
    stack.push_back({m0, m1, m2});
  }
  return true;
}

vec3 unit_mean(const vec3& a, const vec3& b) {
  const vec3 sum = a + b;
  const float length = glm::length(sum);
  return length > 1e-6f ? sum / length : a;
}

uint32_t mean_color(uint32_t a, uint32_t b) {
  uint32_t mean = 0;
  for (int shift = 0; shift < 32; shift += 8)
    mean |= ((((a >> shift) & 255) + ((b >> shift) & 255) + 1) / 2) << shift;
  return mean;
}

Vertex middle(const Vertex& a, const Vertex& b) {
  Vertex m{};
  m.position = midpoint(a.position, b.position);
  m.u0 = 0.5f * a.u0 + 0.5f * b.u0;
  m.v0 = 0.5f * a.v0 + 0.5f * b.v0;
  m.uv1 = 0.5f * a.uv1 + 0.5f * b.uv1;
  m.normal = unit_mean(a.normal, b.normal);
  m.tangent = vec4(unit_mean(vec3(a.tangent), vec3(b.tangent)), a.tangent.w);
  m.color = mean_color(a.color, b.color);
  return m;
}

// A power of two, at least 1 m, below which the longest edge alone would fall into more pieces than
// `triangles`, each a part of the border of another triangle. Keeps coordinates of 1e30 m from costing a
// hundred octaves of counting.
double first_octave(std::span<const SourceMesh> meshes, uint64_t triangles) {
  double longest2 = 0;
  for (const SourceMesh& mesh : meshes) {
    const EdgeRule rule(mesh.scale, 0);
    const auto position = [&](size_t corner) { return mesh.vertices[mesh.indices[corner]].position; };
    for (size_t i = 0; i < mesh.indices.size(); ++i)
      longest2 = std::max(longest2, rule.length2(position(i), position(i - i % 3 + (i + 1) % 3)));
  }
  const double shortest_piece = std::sqrt(longest2) / static_cast<double>(triangles);
  // A quarter, because in a triangle that is flat to the last bit pieces may share a triangle.
  return std::max(1.0, std::exp2(std::floor(std::log2(shortest_piece / 4))));
}

}  // namespace

void split_long_edges(SourceMesh& mesh, double max_edge_m) {
  const EdgeRule rule(mesh.scale, max_edge_m);
  std::unordered_map<uint64_t, uint32_t>
      midpoints;  // by the two ends, so that neighbours share the new vertex
  const auto position = [&](uint32_t v) { return mesh.vertices[v].position; };
  const auto mid = [&](uint32_t a, uint32_t b) {
    const uint64_t edge = uint64_t{std::min(a, b)} << 32 | std::max(a, b);
    const auto [found, is_new] = midpoints.try_emplace(edge, static_cast<uint32_t>(mesh.vertices.size()));
    if (is_new) mesh.vertices.push_back(middle(mesh.vertices[std::min(a, b)], mesh.vertices[std::max(a, b)]));
    return found->second;
  };
  std::vector<uint32_t> indices;
  indices.reserve(mesh.indices.size());
  const auto emit = [&](const Triangle<uint32_t>& t) {
    indices.insert(indices.end(), t.begin(), t.end());
    return true;
  };
  std::vector<Triangle<uint32_t>> stack;
  for (size_t i = 0; i < mesh.indices.size(); i += 3) {
    split_triangle<uint32_t>({mesh.indices[i], mesh.indices[i + 1], mesh.indices[i + 2]}, rule, position, mid,
                             emit, stack);
  }
  mesh.indices = std::move(indices);
}

uint64_t count_after_split(const SourceMesh& mesh, double max_edge_m, uint64_t stop_at) {
  const EdgeRule rule(mesh.scale, max_edge_m);
  uint64_t count = 0;
  const auto emit = [&](const Triangle<vec3>&) { return ++count <= stop_at; };
  const auto position = [](const vec3& p) { return p; };
  std::vector<Triangle<vec3>> stack;
  for (size_t i = 0; i < mesh.indices.size(); i += 3) {
    const Triangle<vec3> t = {mesh.vertices[mesh.indices[i]].position,
                              mesh.vertices[mesh.indices[i + 1]].position,
                              mesh.vertices[mesh.indices[i + 2]].position};
    if (!split_triangle<vec3>(t, rule, position, midpoint, emit, stack)) break;
  }
  return count;
}

double choose_max_edge(std::span<const SourceMesh> meshes, std::span<const uint64_t> instances,
                       uint64_t max_growth) {
  uint64_t total = 0, unique = 0;
  for (size_t i = 0; i < meshes.size(); ++i) {
    total += instances[i] * meshes[i].triangle_count();
    unique += meshes[i].triangle_count();
  }
  const uint64_t budget = std::min(max_growth, std::max<uint64_t>(total * 15 / 100, 100'000));
  const auto fits = [&](double max_edge_m) {
    uint64_t growth = 0;
    for (size_t i = 0; i < meshes.size(); ++i) {
      const uint64_t times = std::max<uint64_t>(instances[i], 1);
      const uint64_t stop_at = meshes[i].triangle_count() + (budget - growth) / times;
      growth += times * (count_after_split(meshes[i], max_edge_m, stop_at) - meshes[i].triangle_count());
      if (growth > budget) return false;
    }
    return true;
  };
  double octave = first_octave(meshes, unique + budget);
  while (true) {
    for (const double step : {0.35, 0.5}) {
      if (fits(step * octave)) return step * octave;
    }
    octave *= 2;
  }
}

}  // namespace tessera::scene
