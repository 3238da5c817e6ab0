#include "scene/mesh/patches.h"

#include <algorithm>
#include <cmath>

namespace tessera::scene {
namespace {

using Triangle = std::array<uint32_t, 3>;
constexpr int kFree = -1;
// A patch may need this much more block area than its parts alone: fewer patches are worth some area.
constexpr double kPairSlack = 1.25, kFanSlack = 1.5;
constexpr double kMinNormalCosine = 0.35;  // sharper folds than about 70 degrees stay apart

// Two triangles that share an edge: edge `edge_a` of `a` runs from corner edge_a to the next one.
struct Candidate {
  int a, b;
  int edge_a, edge_b;
  double score;  // block area of the two alone / as a pair, less for folds and jumps in texture density
  int partner(int t) const { return t == a ? b : a; }
  int edge_of(int t) const { return t == a ? edge_a : edge_b; }
};

// The matching of one meshlet's triangles.
class Matcher {
 public:
  Matcher(std::span<const uint32_t> indices, std::span<const PatchVertex> vertices) : vertices_(vertices) {
    for (size_t i = 0; i + 2 < indices.size(); i += 3) triangles_.push_back({indices[i], indices[i + 1], indices[i + 2]});
    measure();
    find_candidates();
    match_.assign(triangles_.size(), kFree);
  }

  std::vector<PatchTriangles> run() {
    match_greedily();
    while (augment()) {
    }
    attach_lone();
    return collect();
  }

 private:
  struct Measure {
    dvec3 normal;         // unit
    double single;        // block area of the triangle alone
    double density;       // texture area / surface area, signed by orientation
    int largest_angle;    // corner
  };

  const dvec3& at(int t, int corner) const { return vertices_[triangles_[t][corner % 3]].position; }
  double edge_length(int t, int e) const { return glm::distance(at(t, e), at(t, e + 1)); }

  void measure() {
    for (int t = 0; t < static_cast<int>(triangles_.size()); ++t) {
      const dvec3 area = glm::cross(at(t, 1) - at(t, 0), at(t, 2) - at(t, 0));
      const double length = glm::length(area);
      int longest = 0;
      for (int e = 1; e < 3; ++e) longest = edge_length(t, e) > edge_length(t, longest) ? e : longest;
      const glm::dvec2 uv = vertices_[triangles_[t][0]].uv;
      const glm::dvec2 d1 = vertices_[triangles_[t][1]].uv - uv, d2 = vertices_[triangles_[t][2]].uv - uv;
      measures_.push_back({length > 0 ? area / length : dvec3(0),
                           edge_length(t, (longest + 1) % 3) * edge_length(t, (longest + 2) % 3),
                           length > 0 ? (d1.x * d2.y - d1.y * d2.x) / length : 0, (longest + 2) % 3});
    }
  }

  // Only edges that the two triangles run through in opposite directions: a patch has one winding.
  void find_candidates() {
    struct HalfEdge {
      uint32_t from, to;
      int triangle, edge;
    };
    std::vector<HalfEdge> edges;
    for (int t = 0; t < static_cast<int>(triangles_.size()); ++t) {
      for (int e = 0; e < 3; ++e) edges.push_back({triangles_[t][e], triangles_[t][(e + 1) % 3], t, e});
    }
    const auto key = [](const HalfEdge& h) { return std::pair(std::min(h.from, h.to), std::max(h.from, h.to)); };
    std::stable_sort(edges.begin(), edges.end(), [&](const HalfEdge& x, const HalfEdge& y) { return key(x) < key(y); });
    neighbours_.resize(triangles_.size());
    for (size_t i = 0; i < edges.size(); ++i) {
      for (size_t j = i + 1; j < edges.size() && key(edges[i]) == key(edges[j]) && j < i + 4; ++j) {
        if (edges[i].from == edges[j].from || edges[i].triangle == edges[j].triangle) continue;
        add_candidate({edges[i].triangle, edges[j].triangle, edges[i].edge, edges[j].edge, 0});
      }
    }
  }

  void add_candidate(Candidate c) {
    const Measure &a = measures_[c.a], &b = measures_[c.b];
    const double cosine = glm::dot(a.normal, b.normal);
    const double pair = pair_area(c);
    if (!(cosine >= kMinNormalCosine) || !(pair <= kPairSlack * (a.single + b.single))) return;
    const double low = std::min(std::abs(a.density), std::abs(b.density));
    const double high = std::max(std::abs(a.density), std::abs(b.density));
    const bool same_density = high == 0 || (a.density * b.density > 0 && low > 0.5 * high);
    c.score = (a.single + b.single) / pair * (0.5 + 0.5 * cosine) * (same_density ? 1 : 0.8);
    neighbours_[c.a].push_back(static_cast<int>(candidates_.size()));
    neighbours_[c.b].push_back(static_cast<int>(candidates_.size()));
    candidates_.push_back(c);
  }

  // Corners a (0,0), b (1,0), c (0,1), d (1,1); b-c is the shared edge.
  double pair_area(const Candidate& x) const {
    const dvec3 &a = at(x.a, x.edge_a + 2), &b = at(x.a, x.edge_a), &c = at(x.a, x.edge_a + 1);
    const dvec3& d = at(x.b, x.edge_b + 2);
    return std::max(glm::distance(a, b), glm::distance(c, d)) * std::max(glm::distance(a, c), glm::distance(b, d));
  }

  // Best first; among about equal ones, those whose triangles have the fewest other partners.
  void match_greedily() {
    std::vector<int> degree(triangles_.size());
    for (size_t t = 0; t < degree.size(); ++t) degree[t] = static_cast<int>(neighbours_[t].size());
    const auto rank = [&](const Candidate& c) {
      return 8 * std::floor(4 * c.score) - std::min(degree[c.a], degree[c.b]) + 0.1 * c.score;
    };
    while (true) {
      const Candidate* best = nullptr;
      double best_rank = 0;
      for (const Candidate& c : candidates_) {
        if (match_[c.a] != kFree || match_[c.b] != kFree) continue;
        if (const double r = rank(c); !best || r > best_rank) best = &c, best_rank = r;
      }
      if (!best) return;
      join(static_cast<int>(best - candidates_.data()));
      for (const int t : {best->a, best->b}) {
        for (const int n : neighbours_[t]) --degree[candidates_[n].partner(t)];
      }
    }
  }

  void join(int candidate) { match_[candidates_[candidate].a] = match_[candidates_[candidate].b] = candidate; }

  // Frees a pair whose two triangles can each take a lone neighbour instead. Returns whether it found one.
  bool augment() {
    for (int t = 0; t < static_cast<int>(triangles_.size()); ++t) {
      if (match_[t] != kFree) continue;
      for (const int first : neighbours_[t]) {
        const int v = candidates_[first].partner(t);
        if (match_[v] == kFree) {
          join(first);
          return true;
        }
        const int w = candidates_[match_[v]].partner(v);
        for (const int second : neighbours_[w]) {
          const int x = candidates_[second].partner(w);
          if (x == t || x == v || match_[x] != kFree) continue;
          join(first);
          join(second);
          return true;
        }
      }
    }
    return false;
  }

  // The fan of a lone triangle `left`, its neighbour `middle` and that one's partner, or none if it does not fit.
  PatchTriangles fan(int link, int middle, double& area) const {
    const Candidate &l = candidates_[link], &r = candidates_[match_[middle]];
    const bool swap = r.edge_of(middle) != (l.edge_of(middle) + 2) % 3;
    const Candidate &left = swap ? r : l, &right = swap ? l : r;
    const int k = left.edge_of(middle);  // corner k is the fan's apex
    const auto corner = [&](const Candidate& c) {
      const int other = c.partner(middle);
      return triangles_[other][(c.edge_of(other) + 2) % 3];
    };
    const uint32_t m = triangles_[middle][k], p = triangles_[middle][(k + 1) % 3], q = triangles_[middle][(k + 2) % 3];
    const uint32_t first = corner(left), last = corner(right);
    const auto length = [&](uint32_t a, uint32_t b) { return glm::distance(vertices_[a].position, vertices_[b].position); };
    area = first == last ? INFINITY
                         : std::max(length(p, q), length(first, m) + length(m, last)) *
                               std::max(length(first, p), length(q, last));
    return {3, {{{p, q, m}, {first, p, m}, {q, last, m}}}};
  }

  void attach_lone() {
    in_fan_.assign(triangles_.size(), kFree);
    for (int t = 0; t < static_cast<int>(triangles_.size()); ++t) {
      if (match_[t] != kFree) continue;
      double best_ratio = kFanSlack;
      PatchTriangles best;
      int best_pair = kFree;
      for (const int link : neighbours_[t]) {
        const int middle = candidates_[link].partner(t);
        if (match_[middle] == kFree || in_fan_[middle] != kFree) continue;
        double area = 0;
        const PatchTriangles patch = fan(link, middle, area);
        const double ratio = area / (pair_area(candidates_[match_[middle]]) + measures_[t].single);
        if (ratio <= best_ratio) best_ratio = ratio, best = patch, best_pair = match_[middle];
      }
      if (best_pair == kFree) continue;
      for (const int member : {t, candidates_[best_pair].a, candidates_[best_pair].b}) {
        in_fan_[member] = static_cast<int>(fans_.size());
      }
      fans_.push_back(best);
    }
  }

  std::vector<PatchTriangles> collect() const {
    std::vector<PatchTriangles> patches;
    std::vector<bool> fan_done(fans_.size());
    for (int t = 0; t < static_cast<int>(triangles_.size()); ++t) {
      if (in_fan_[t] != kFree) {
        if (!fan_done[in_fan_[t]]) patches.push_back(fans_[in_fan_[t]]);
        fan_done[in_fan_[t]] = true;
      } else if (match_[t] == kFree) {
        const int k = measures_[t].largest_angle;  // at (0,0): the longest edge becomes the block's diagonal
        patches.push_back({1, {{{triangles_[t][k], triangles_[t][(k + 1) % 3], triangles_[t][(k + 2) % 3]}}}});
      } else if (const Candidate& c = candidates_[match_[t]]; t == std::min(c.a, c.b)) {
        const Triangle &a = triangles_[c.a], &b = triangles_[c.b];
        patches.push_back({2,
                           {{{a[(c.edge_a + 2) % 3], a[c.edge_a], a[(c.edge_a + 1) % 3]},
                             {b[(c.edge_b + 2) % 3], b[c.edge_b], b[(c.edge_b + 1) % 3]}}}});
      }
    }
    return patches;
  }

  std::span<const PatchVertex> vertices_;
  std::vector<Triangle> triangles_;
  std::vector<Measure> measures_;
  std::vector<Candidate> candidates_;
  std::vector<std::vector<int>> neighbours_;  // candidates by triangle
  std::vector<int> match_;                    // candidate by triangle
  std::vector<int> in_fan_;                   // index into fans_ by triangle
  std::vector<PatchTriangles> fans_;
};

}  // namespace

std::vector<PatchTriangles> make_patches(std::span<const uint32_t> indices, std::span<const PatchVertex> vertices) {
  return Matcher(indices, vertices).run();
}

}  // namespace tessera::scene
