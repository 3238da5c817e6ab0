// Sizes of layout `coherent`: rectangles of even sides, chosen for each axis of the patch on its own, so that
// samples lie evenly and everywhere equally dense on the screen, whatever the patch's shape and size.
#pragma once

#include <span>
#include <vector>

#include "atlas/coherent/slabs.h"
#include "atlas/level_selection.h"

namespace tessera::atlas::coherent {

// What a patch asks for before bias: intervals between samples along its axes, of the colour part.
struct RectangleNeed {
  float u = 0, v = 0;
  float area = 0;  // u * v
};
RectangleNeed rectangle_need(const scene::Footprint& footprint, uint8_t triangle_count);

// Texels of the colour part along the patch's axes. 0 x 0: a single colour.
struct RectangleSize {
  uint16_t u = 0, v = 0;
  bool single_color() const { return u == 0; }
  bool operator==(const RectangleSize&) const = default;
};

// The largest sides that a rectangle may have, in texels: those of the largest slab, or of a smaller atlas.
struct MostSides {
  uint16_t width = kLongestSide, height = kLongestSide;
};
MostSides most_sides(uint32_t atlas_width, uint32_t atlas_height);

// The size at a bias (as in eq. 3.3: 1 halves the area); `previous` (or nullptr) stays as long as it
// is good enough.
RectangleSize select_size(const RectangleNeed& need, bool masked, float bias, const RectangleSize* previous,
                          const LevelSettings& settings, const MostSides& most = {});

// Sides in the atlas, with coverage: the long one is the width.
uvec2 sides_of(const RectangleSize& size, bool masked);

// The smallest bias at which all rectangles together have at most `target_texels`; clamped to the settings'
// range. Monotonic: a smaller target never gives a smaller bias. `near`: see least_bias().
struct Wanted {
  RectangleNeed need;
  bool masked = false;
};
float select_bias(std::span<const Wanted> wanted, double target_texels, const LevelSettings& settings,
                  const MostSides& most = {}, float near = 0);

}  // namespace tessera::atlas::coherent
