// Texel shading (Hillesland and Yang 2016), the baseline of TSS section 5: every surface has its own texels
// in a texture of fixed resolution with mip levels, and the tiles of 8x8 texels that a picture reads are
// shaded.
//
// Here each instance has a texture of its own, so a tile has one material. It is unwrapped by a simple
// packing: patches (scene::Patch) as rectangles in rows. Level 0 has as many texels per metre everywhere as a
// budget allows; a coarser level has half as many along each side, and what a texel shows is what lies at its
// centre, so that at coarse levels neighbours in the texture mix, as in the publication.
#pragma once

#include <compare>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/math.h"
#include "base/status.h"
#include "base/view.h"
#include "pvs/visibility.h"
#include "scene/scene.h"

namespace tessera::bench {

constexpr uint32_t kTexelTile = 8;  // texels along a side
constexpr uint32_t kTexelTileTexels = kTexelTile * kTexelTile;

// Of a mip level of an instance's texture.
struct TexelTile {
  uint32_t instance = 0;
  uint32_t level = 0;
  uint32_t x = 0, y = 0;  // in tiles
  auto operator<=>(const TexelTile&) const = default;
};

// Where a pixel reads: bilinearly in one mip level.
struct TexelLookup {
  uint32_t instance = 0;
  uint32_t level = 0;
  vec2 position{0};  // in the level's texels, whose centres are at whole numbers
};

// What a texel shows.
struct TexelPoint {
  uint32_t patch = scene::kNone;  // of the instance's geometry; kNone: nothing, it lies between patches
  vec2 at{0};                     // along the patch's axes from its first corner, in texels of level 0
  vec2 extent{1};                 // of the patch, from its first corner to the far one
};

// Where a patch lies in level 0 of its instance's texture.
struct TexelRectangle {
  uint32_t x = 0, y = 0, width = 0, height = 0;
};

// Immutable. `transforms`: world matrix of each instance.
class UniqueTexture {
 public:
  // `texels`: of level 0, all instances together; a budget. InvalidArgument if it has no room for 2x2 texels
  // a patch.
  static StatusOr<UniqueTexture> create(const scene::Scene& scene, std::span<const dmat4> transforms,
                                        uint64_t texels);

  uint64_t texels() const;          // of level 0
  double texels_per_metre() const;  // of level 0
  uint32_t levels(uint32_t instance) const;
  uvec2 size(uint32_t instance, uint32_t level) const;  // texels
  // By patch of the instance's geometry.
  std::span<const TexelRectangle> patches(uint32_t instance) const { return charts_[instance].patches; }
  TexelPoint texel(uint32_t instance, uint32_t level, uvec2 texel) const;

  // By the triangle that the pixel (x, y from the upper left) shows, an instanced one (scene::Instance). The
  // mip level is the one whose texels come nearest to the pixel's longer axis on the surface.
  TexelLookup lookup(uint32_t triangle, const View& view, uvec2 pixel,
                     std::span<const dmat4> transforms) const;

  // The tiles that the lookups of a picture touch, sorted. `triangle_plus_one`: row by row, 0 = background
  // (pvs::IdBuffer, shading::ReferenceImage).
  std::vector<TexelTile> visible_tiles(std::span<const uint32_t> triangle_plus_one, const View& view,
                                       std::span<const dmat4> transforms) const;
  // Texels of a tile that show something: what has to be shaded of it.
  uint32_t samples(const TexelTile& tile) const;

 private:
  struct Row {
    uint32_t y, height;
    uint32_t begin, end;  // in Chart::by_place
  };
  // The texture of an instance.
  struct Chart {
    uint32_t width = 0, height = 0;
    std::vector<TexelRectangle> patches;
    std::vector<uint32_t> by_place;  // patches row by row, left to right
    std::vector<Row> rows;
  };
  struct PatchSize {
    float u_m, v_m;
  };

  explicit UniqueTexture(const scene::Scene& scene) : scene_(&scene), patch_of_(scene) {}
  static std::vector<PatchSize> patch_sizes(const scene::Geometry& geometry, const dmat4& transform);
  static Chart pack(std::span<const PatchSize> sizes, double texels_per_metre);

  const scene::Scene* scene_;
  pvs::TriangleToPatch patch_of_;
  std::vector<Chart> charts_;  // by instance
  double texels_per_metre_ = 0;
};

}  // namespace tessera::bench
