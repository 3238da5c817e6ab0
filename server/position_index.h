// Vertices of a geometry that share a position (seams of normals or texture coordinates) under one number:
// the client draws positions only.
#pragma once

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <span>
#include <tuple>
#include <vector>

#include "scene/scene.h"

namespace tessera::server {

class PositionIndex {
 public:
  PositionIndex() = default;
  explicit PositionIndex(std::span<const scene::Vertex> vertices) : index_(vertices.size()) {
    std::vector<uint32_t> order(vertices.size());
    std::iota(order.begin(), order.end(), 0u);
    const auto key = [&](uint32_t v) {
      const vec3& p = vertices[v].position;
      return std::tuple(p.x, p.y, p.z);
    };
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return key(a) < key(b); });
    for (size_t i = 0; i < order.size(); ++i) {
      if (i == 0 || key(order[i - 1]) != key(order[i])) ++count_;
      index_[order[i]] = count_ - 1;
    }
  }

  uint32_t operator[](uint32_t vertex) const { return index_[vertex]; }
  uint32_t count() const { return count_; }

 private:
  std::vector<uint32_t> index_;
  uint32_t count_ = 0;
};

}  // namespace tessera::server
