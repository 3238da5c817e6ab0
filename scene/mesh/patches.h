// Grouping the triangles of a meshlet into patches of one to three.
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
  dvec3 position;   // scaled to world proportions
  glm::dvec2 uv;    // base texture coordinates
};

// `indices`: 3 a triangle, into `vertices`. Every triangle lands in exactly one patch, with its winding. Minimises, by a
// greedy matching with augmentation, the area of the blocks that the patches need; patches appear in triangle order.
std::vector<PatchTriangles> make_patches(std::span<const uint32_t> indices, std::span<const PatchVertex> vertices);

}  // namespace tessera::scene
