// Where a patch's samples lie. The one vocabulary between atlas/, shading/, the wire and the client.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "scene/scene.h"

namespace tessera::atlas {

enum class PlacementKind : uint8_t {
  block,  // a rectangle of the atlas
  color,  // one colour for the whole patch, sent beside the video: it is small, or the atlas is full
};

// Spacing of samples in a block, a corner: the corner's distance from the eye over that of corner 0, as
// addressing::ratio_code() - kRatioCodeOne: 21 codes an octave, 0 = the same distance, clamped to 1/64..64
// (+-126).
using SpacingCode = int8_t;

// Within a block, corner c of the patch (scene::patch_corner) lies at the centre of texel
//   x + round(c.u * (width - 1)), y + round(c.v * (height - 1))      (u and v swapped if transposed)
// so that a bilinear fetch never leaves the block (half-texel inset, thesis fig. 3.4). Between the corners of
// a triangle samples are evenly spaced on the surface if its spacing codes are equal, else as seen by the eye
// that the codes stand for (TSS eq. 5). A masked patch's block is split in halves: left and right if it is
// wider than high, else upper and lower. Colour lies in the first half, coverage as grey in the second; the
// map above then holds for the colour half. As code: atlas/addressing/block.glsl.
struct Placement {
  scene::PatchId patch = scene::kNone;
  PlacementKind kind = PlacementKind::color;
  // Kind block, in texels, all even.
  uint16_t x = 0, y = 0;
  uint16_t width = 0, height = 0;
  bool transposed = false;               // the patch's u axis runs down
  bool masked = false;                   // has coverage
  std::array<SpacingCode, 4> spacing{};  // of corners 1..4 (geometry_compression::NewPatch); corner 0 has 0
  bool operator==(const Placement&) const = default;

  uint64_t texels() const { return uint64_t{width} * height; }
  // Size of the colour part, in texels; coverage has the same size.
  uint32_t color_width() const { return masked && width > height ? width / 2u : width; }
  uint32_t color_height() const { return masked && width <= height ? height / 2u : height; }
};

// What changed between two frames of a layout.
struct LayoutDelta {
  std::vector<Placement> changed;       // new, moved or of another size or kind; sorted by patch
  std::vector<scene::PatchId> removed;  // sorted
};

// From one list of placements to the next, both sorted by patch.
LayoutDelta difference(std::span<const Placement> before, std::span<const Placement> after);

}  // namespace tessera::atlas
