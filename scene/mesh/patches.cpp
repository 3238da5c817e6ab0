#include "scene/mesh/patches.h"

#include <algorithm>
#include <cmath>
#include <queue>
#include <tuple>

namespace tessera::scene {
namespace {

constexpr uint32_t kNoMatch = 0xffffffffu;
// A patch may need this much more block area than its parts alone: fewer patches are worth some area.
constexpr double kPairSlack = 1.6, kFanSlack = 2;
constexpr double kMinNormalCosine = 0.35;  // sharper folds than about 70 degrees stay apart

}  // namespace

PatchMaker::PatchMaker(std::span<const uint32_t> indices, std::span<const PatchVertex> vertices)
    : indices_(indices), vertices_(vertices), triangle_count_(static_cast<uint32_t>(indices.size() / 3)) {
  measure();
  find_candidates();
  index_candidates();
  match_.assign(triangle_count_, kNoMatch);
  match_greedily();
  while (augment()) {
  }
  for (uint32_t t = 0; t < triangle_count_; ++t) {
    if (is_free(t) || t == std::min(candidates_[match_[t]].a, candidates_[match_[t]].b))
      representatives_.push_back(t);
  }
  slot_.assign(triangle_count_, kNoMatch);
}

bool PatchMaker::is_free(uint32_t t) const {
  return match_[t] == kNoMatch;
}

void PatchMaker::measure() {
  measures_.reserve(triangle_count_);
  for (uint32_t t = 0; t < triangle_count_; ++t) {
    const dvec3 area = glm::cross(at(t, 1) - at(t, 0), at(t, 2) - at(t, 0));
    const double twice = glm::length(area);
    std::array<double, 3> edge;
    for (uint32_t e = 0; e < 3; ++e) edge[e] = glm::distance(at(t, e), at(t, e + 1));
    const auto longest = static_cast<uint32_t>(std::max_element(edge.begin(), edge.end()) - edge.begin());
    const glm::dvec2 uv = vertices_[corner(t, 0)].uv;
    const glm::dvec2 d1 = vertices_[corner(t, 1)].uv - uv, d2 = vertices_[corner(t, 2)].uv - uv;
    measures_.push_back({twice > 0 ? area / twice : dvec3(0),
                         edge[(longest + 1) % 3] * edge[(longest + 2) % 3],
                         twice > 0 ? (d1.x * d2.y - d1.y * d2.x) / twice : 0, (longest + 2) % 3});
  }
}

// Only edges that the two triangles run through in opposite directions: a patch has one winding.
void PatchMaker::find_candidates() {
  struct HalfEdge {
    uint64_t key;  // its two vertices
    uint32_t triangle, edge;
  };
  std::vector<HalfEdge> edges;
  edges.reserve(indices_.size());
  for (uint32_t t = 0; t < triangle_count_; ++t) {
    for (uint32_t e = 0; e < 3; ++e) {
      const uint32_t from = corner(t, e), to = corner(t, e + 1);
      edges.push_back({uint64_t{std::min(from, to)} << 32 | std::max(from, to), t, e});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const HalfEdge& x, const HalfEdge& y) {
    return std::tie(x.key, x.triangle, x.edge) < std::tie(y.key, y.triangle, y.edge);
  });
  constexpr size_t kReach = 3;  // bounds the work where hundreds of triangles meet at one edge
  for (size_t i = 0; i < edges.size(); ++i) {
    for (size_t j = i + 1; j < std::min(edges.size(), i + 1 + kReach) && edges[j].key == edges[i].key; ++j) {
      if (corner(edges[i].triangle, edges[i].edge) == corner(edges[j].triangle, edges[j].edge)) continue;
      add_candidate({edges[i].triangle, edges[j].triangle, edges[i].edge, edges[j].edge, 0});
    }
  }
}

void PatchMaker::add_candidate(Candidate c) {
  const Measure &a = measures_[c.a], &b = measures_[c.b];
  const double cosine = glm::dot(a.normal, b.normal), pair = pair_area(c);
  if (!(cosine >= kMinNormalCosine) || !(pair <= kPairSlack * (a.single + b.single))) return;
  const double low = std::min(std::abs(a.density), std::abs(b.density));
  const double high = std::max(std::abs(a.density), std::abs(b.density));
  const bool same_density = high == 0 || (a.density * b.density > 0 && low > 0.5 * high);
  c.score =
      static_cast<float>((a.single + b.single) / pair * (0.5 + 0.5 * cosine) * (same_density ? 1 : 0.8));
  candidates_.push_back(c);
}

void PatchMaker::index_candidates() {
  first_candidate_.assign(triangle_count_ + 1, 0);
  for (const Candidate& c : candidates_) ++first_candidate_[c.a + 1], ++first_candidate_[c.b + 1];
  for (uint32_t t = 0; t < triangle_count_; ++t) first_candidate_[t + 1] += first_candidate_[t];
  by_triangle_.resize(2 * candidates_.size());
  std::vector<uint32_t> next(first_candidate_.begin(), first_candidate_.end() - 1);
  for (uint32_t c = 0; c < candidates_.size(); ++c) {
    by_triangle_[next[candidates_[c].a]++] = c;
    by_triangle_[next[candidates_[c].b]++] = c;
  }
}

// Corners a (0,0), b (1,0), c (0,1), d (1,1); b-c is the shared edge.
double PatchMaker::pair_area(const Candidate& x) const {
  const dvec3 &a = at(x.a, x.edge_a + 2), &b = at(x.a, x.edge_a), &c = at(x.a, x.edge_a + 1);
  const dvec3& d = at(x.b, x.edge_b + 2);
  return std::max(glm::distance(a, b), glm::distance(c, d)) *
         std::max(glm::distance(a, c), glm::distance(b, d));
}

// Best first; among about equal ones, those whose triangles have the fewest other partners left.
void PatchMaker::match_greedily() {
  std::vector<uint32_t> degree(triangle_count_);
  for (uint32_t t = 0; t < triangle_count_; ++t) degree[t] = static_cast<uint32_t>(candidates_of(t).size());
  const auto rank = [&](const Candidate& c) {
    return 8 * std::floor(4 * c.score) - static_cast<float>(std::min(degree[c.a], degree[c.b]));
  };
  // An entry whose rank is out of date has a newer one in the queue. Earlier candidates go first.
  using Entry = std::tuple<float, float, uint32_t>;
  std::vector<Entry> entries;
  for (uint32_t c = 0; c < candidates_.size(); ++c)
    entries.push_back({rank(candidates_[c]), candidates_[c].score, ~c});
  std::priority_queue<Entry> queue(std::less<Entry>(), std::move(entries));
  while (!queue.empty()) {
    const auto [stored, score, inverse] = queue.top();
    queue.pop();
    const Candidate& best = candidates_[~inverse];
    if (!is_free(best.a) || !is_free(best.b) || stored != rank(best)) continue;
    join(~inverse);
    for (const uint32_t t : {best.a, best.b}) {
      for (const uint32_t lost : candidates_of(t)) {
        const uint32_t other = candidates_[lost].partner(t);
        --degree[other];
        if (!is_free(other)) continue;
        for (const uint32_t c : candidates_of(other))
          queue.push({rank(candidates_[c]), candidates_[c].score, ~c});
      }
    }
  }
}

void PatchMaker::join(uint32_t candidate) {
  match_[candidates_[candidate].a] = match_[candidates_[candidate].b] = candidate;
}

// One pass over the lone triangles. Returns whether it paired any.
bool PatchMaker::augment() {
  bool found = false;
  for (uint32_t t = 0; t < triangle_count_; ++t) found |= is_free(t) && augment_from(t);
  return found;
}

// Breaks up a neighbouring pair if its other triangle can take a lone neighbour of its own instead.
bool PatchMaker::augment_from(uint32_t t) {
  for (const uint32_t first : candidates_of(t)) {
    const uint32_t v = candidates_[first].partner(t);
    if (is_free(v)) {
      join(first);
      return true;
    }
    const uint32_t w = candidates_[match_[v]].partner(v);
    for (const uint32_t second : candidates_of(w)) {
      const uint32_t x = candidates_[second].partner(w);
      if (x == t || x == v || !is_free(x)) continue;
      join(first);
      join(second);
      return true;
    }
  }
  return false;
}

PatchTriangles PatchMaker::lone_patch(uint32_t t) const {
  const uint32_t k = measures_[t].largest_angle;  // at (0,0): the longest edge becomes the block's diagonal
  return {1, {{{corner(t, k), corner(t, k + 1), corner(t, k + 2)}}}};
}

PatchTriangles PatchMaker::pair_patch(const Candidate& c) const {
  return {2,
          {{{corner(c.a, c.edge_a + 2), corner(c.a, c.edge_a), corner(c.a, c.edge_a + 1)},
            {corner(c.b, c.edge_b + 2), corner(c.b, c.edge_b), corner(c.b, c.edge_b + 1)}}}};
}

// The fan of a lone triangle, its neighbour `middle` over the candidate `link`, and that one's partner; and
// the area of its block.
PatchTriangles PatchMaker::fan_patch(uint32_t link, uint32_t middle, double& area) const {
  const Candidate &l = candidates_[link], &r = candidates_[match_[middle]];
  const bool swap = r.edge_of(middle) != (l.edge_of(middle) + 2) % 3;
  const Candidate &left = swap ? r : l, &right = swap ? l : r;
  const uint32_t k = left.edge_of(middle);  // corner k is the fan's apex
  const auto opposite = [&](const Candidate& c) {
    return corner(c.partner(middle), c.edge_of(c.partner(middle)) + 2);
  };
  const uint32_t m = corner(middle, k), p = corner(middle, k + 1), q = corner(middle, k + 2);
  const uint32_t first = opposite(left), last = opposite(right);
  const auto length = [&](uint32_t a, uint32_t b) {
    return glm::distance(vertices_[a].position, vertices_[b].position);
  };
  area = first == last ? INFINITY  // a closed corner of three triangles does not open into a fan
                       : std::max(length(p, q), length(first, m) + length(m, last)) *
                             std::max(length(first, p), length(q, last));
  return {3, {{{p, q, m}, {first, p, m}, {q, last, m}}}};
}

// Fans of the cluster's lone triangles with its pairs; `taken` by position in the cluster.
std::vector<PatchTriangles> PatchMaker::attach_lone(std::span<const uint32_t> cluster,
                                                    std::vector<bool>& taken) const {
  std::vector<PatchTriangles> fans;
  for (const uint32_t t : cluster) {
    if (!is_free(t)) continue;
    double best_ratio = kFanSlack;
    PatchTriangles best;
    uint32_t best_slot = kNoMatch;
    for (const uint32_t link : candidates_of(t)) {
      const uint32_t middle = candidates_[link].partner(t);
      if (is_free(middle)) continue;
      const Candidate& pair = candidates_[match_[middle]];
      const uint32_t slot = slot_[std::min(pair.a, pair.b)];
      if (slot == kNoMatch || taken[slot]) continue;
      double area = 0;
      const PatchTriangles fan = fan_patch(link, middle, area);
      const double ratio = area / (pair_area(pair) + measures_[t].single);
      if (ratio <= best_ratio) best_ratio = ratio, best = fan, best_slot = slot;
    }
    if (best_slot == kNoMatch) continue;
    taken[slot_[t]] = taken[best_slot] = true;
    fans.push_back(best);
  }
  return fans;
}

std::vector<PatchTriangles> PatchMaker::make_patches(std::span<const uint32_t> cluster) {
  for (uint32_t i = 0; i < cluster.size(); ++i) slot_[cluster[i]] = i;
  std::vector<bool> taken(cluster.size());
  std::vector<PatchTriangles> patches = attach_lone(cluster, taken);
  for (uint32_t i = 0; i < cluster.size(); ++i) {
    const uint32_t t = cluster[i];
    if (!taken[i]) patches.push_back(is_free(t) ? lone_patch(t) : pair_patch(candidates_[match_[t]]));
    slot_[t] = kNoMatch;
  }
  return patches;
}

}  // namespace tessera::scene
