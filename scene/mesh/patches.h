// Grouping the triangles of a mesh into patches of one to three.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "base/math.h"

namespace tessera::scene {

// The triangles of one patch in the order and with the corners that patch_corner() describes.
struct PatchTriangles {
  uint32_t count = 0;
  std::array<std::array<uint32_t, 3>, 3> triangles{};
};

struct PatchVertex {
  dvec3 position;  // in world proportions
  glm::dvec2 uv;   // base texture coordinates
};

// Pairs adjacent triangles, by a greedy matching with augmentation that minimises the area of the blocks that
// patches need; clusters of pairs and lone triangles then become patches, some of three triangles.
class PatchMaker {
 public:
  // `indices`: 3 a triangle, into `vertices`. Both must outlive the maker.
  PatchMaker(std::span<const uint32_t> indices, std::span<const PatchVertex> vertices);

  // One triangle of each pair, and the lone ones.
  const std::vector<uint32_t>& representatives() const { return representatives_; }

  // The patches of a cluster of representatives: every triangle of theirs lands in exactly one patch, with
  // its winding.
  std::vector<PatchTriangles> make_patches(std::span<const uint32_t> cluster);

 private:
  // Two triangles that share an edge: edge `edge_a` of `a` runs from its corner edge_a to the next one.
  struct Candidate {
    uint32_t a, b;
    uint32_t edge_a, edge_b;
    float score;  // block area of the two alone / as a pair, less for folds and jumps in texture density
    uint32_t partner(uint32_t t) const { return t == a ? b : a; }
    uint32_t edge_of(uint32_t t) const { return t == a ? edge_a : edge_b; }
  };
  struct Measure {
    dvec3 normal;            // unit
    double single;           // block area of the triangle alone
    double density;          // texture area / surface area, signed by orientation
    uint32_t largest_angle;  // corner
  };

  uint32_t corner(uint32_t t, uint32_t k) const { return indices_[3 * t + k % 3]; }
  const dvec3& at(uint32_t t, uint32_t k) const { return vertices_[corner(t, k)].position; }
  std::span<const uint32_t> candidates_of(uint32_t t) const {
    return std::span(by_triangle_)
        .subspan(first_candidate_[t], first_candidate_[t + 1] - first_candidate_[t]);
  }
  bool is_free(uint32_t t) const;
  void measure();
  void find_candidates();
  void add_candidate(Candidate c);
  void index_candidates();
  double pair_area(const Candidate& c) const;
  void match_greedily();
  void join(uint32_t candidate);
  bool augment();
  bool augment_from(uint32_t triangle);
  PatchTriangles lone_patch(uint32_t t) const;
  PatchTriangles pair_patch(const Candidate& c) const;
  PatchTriangles fan_patch(uint32_t link, uint32_t middle, double& area) const;
  std::vector<PatchTriangles> attach_lone(std::span<const uint32_t> cluster, std::vector<bool>& taken) const;

  std::span<const uint32_t> indices_;
  std::span<const PatchVertex> vertices_;
  uint32_t triangle_count_;
  std::vector<Measure> measures_;
  std::vector<Candidate> candidates_;
  std::vector<uint32_t> first_candidate_, by_triangle_;  // candidates of each triangle
  std::vector<uint32_t> match_;                          // candidate by triangle
  std::vector<uint32_t> representatives_;
  std::vector<uint32_t> slot_;  // position in the cluster at work, by representative
};

}  // namespace tessera::scene
