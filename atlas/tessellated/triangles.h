// What a triangle asks for in layout `tessellated`, and the shape that it gets (TSS sections 3.2, 3.3).
#pragma once

#include <array>
#include <span>
#include <vector>

#include "atlas/layout.h"
#include "scene/visible_set.h"

namespace tessera::atlas::tessellated {

// Of one triangle, in pixels of the screen that its patch's footprint is for; any of them may be no number.
struct TriangleNeed {
  float area = 0;
  float base = 0;     // longest edge
  float foot = 0.5f;  // where the height meets it, from its first corner; 0..1 (TSS eq. 12)
  uint8_t apex = 0;   // the corner that it lies opposite of
  bool masked = false;
};

// By distances from the eye, not by depths: see spacing in coherent/spacing.h.
struct SeenTriangle {
  TriangleNeed need;
  std::array<SpacingCode, 2> spacing{};  // of corners 1 and 2
};

// Triangles of one patch as `eye` sees them (thesis eq. 3.1). Each gets its share of the patch's footprint,
// so what scales footprints scales them too. Returns how many there are. Any input gives valid values.
uint32_t see(const scene::Geometry& geometry, const scene::Patch& patch, const scene::Footprint& footprint,
             const dmat4& transform, const dvec3& eye, std::span<SeenTriangle, 3> out);

// How many samples, and arranged how. Kind color, l or halves.
struct Shape {
  PlacementKind kind = PlacementKind::color;
  uint8_t level = 0, splits = 0;    // l
  uint8_t across = 0;               // halves
  std::array<uint16_t, 2> along{};  // halves
  bool operator==(const Shape&) const = default;
};

// The largest that an atlas can hold.
struct ShapeLimits {
  int level;
  int half_length;
  int half_width;
};
ShapeLimits limits_for(uint32_t atlas_width, uint32_t atlas_height);

// Intervals between samples, not samples, match the area: an L of level l has 3/4 l^2 quads between its
// samples, a half as many as a rectangle of half its bounding one. `bias` as in eq. 3.3: 1 halves the area.
Shape select_shape(const TriangleNeed& need, float bias, const LayoutSettings& settings,
                   const ShapeLimits& limits);

// Texels of the atlas that it will take with its share of the rectangles around it.
uint64_t texels_of(const Shape& shape, bool masked);

// The smallest bias at which all of them have at most `target_texels`; clamped to the settings' range.
// Monotonic in the target.
float select_bias(std::span<const TriangleNeed> needs, double target_texels, const LayoutSettings& settings,
                  const ShapeLimits& limits);

}  // namespace tessera::atlas::tessellated
