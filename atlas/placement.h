// Where a patch's samples lie. The one vocabulary between atlas/, shading/, the wire and the client.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "scene/scene.h"

namespace tessera::atlas {

enum class PlacementKind : uint8_t {
  block,   // a rectangle of the atlas
  color,   // one colour for all of it, sent beside the video: it is small, or the atlas is full
  l,       // a triangle as one L or several, by L-packing (TSS section 3.2)
  halves,  // a triangle as two right-angled ones, by Oversampling (TSS section 3.3)
};

// What of a patch a placement is for. A patch is placed whole, or each of its triangles is.
using PatchPart = uint8_t;
constexpr PatchPart kWholePatch = 0;
constexpr PatchPart part_of(uint32_t triangle) {
  return static_cast<PatchPart>(1 + triangle);
}

// Spacing of samples in a block, a corner: the corner's distance from the eye over that of corner 0, as
// addressing::ratio_code() - kRatioCodeOne: 21 codes an octave, 0 = the same distance, clamped to 1/64..64
// (+-126).
using SpacingCode = int8_t;
// What is no number counts as 1/64.
SpacingCode spacing_code(double ratio);

// Kind l. Samples: atlas/addressing/split.glsl and l_packing.glsl. The placement's x and y are the upper left
// corner of the pair of Ls that holds the first, even. A masked triangle takes whole pairs: colour lies in
// the one that is not turned, coverage as grey in the turned one.
struct LPlace {
  uint8_t level = 0;    // 1..addressing::kMaxTessellationLevel
  uint8_t splits = 1;   // each edge's parts, 1..addressing::kMaxSplits: splits^2 Ls follow each other
  bool turned = false;  // the first is the turned one of its pair; never if masked
  // Of the row of pairs after the first one; 0 where it is not needed.
  uint16_t next_y = 0;
  bool operator==(const LPlace&) const = default;
};

// Kind halves. Samples: atlas/addressing/halves.glsl. Its height parts the triangle in half 0, at the base's
// first corner, and half 1. Not for masked triangles.
struct HalfPlace {
  uint16_t x = 0, y = 0;  // upper left corner of the bounding rectangle; y even
  uint16_t along = 0;     // intervals between samples along the base: 1..addressing::kMaxHalfLength
  bool turned = false;    // by 180 degrees
  bool operator==(const HalfPlace&) const = default;
};
struct HalvesPlace {
  uint8_t apex =
      0;  // the corner that the longest edge, the base, lies opposite of; its first is the next one
  uint8_t foot = 0;    // where the height meets the base: code of addressing::foot_from_code(), 0..63
  uint8_t across = 0;  // intervals along the height: 1..addressing::kMaxHalfWidth
  std::array<HalfPlace, 2> half{};
  bool operator==(const HalvesPlace&) const = default;
};

// Within a block, corner c of the patch (scene::patch_corner) lies at the centre of texel
//   x + round(c.u * (width - 1)), y + round(c.v * (height - 1))      (u and v swapped if transposed)
// so that a bilinear fetch never leaves the block (half-texel inset, thesis fig. 3.4). Between the corners of
// a triangle samples are evenly spaced on the surface if its spacing codes are equal, else as seen by the eye
// that the codes stand for (TSS eq. 5). A masked patch's block is split in halves: left and right if it is
// wider than high, else upper and lower. Colour lies in the first half, coverage as grey in the second; the
// map above then holds for the colour half. As code: atlas/addressing/block.glsl.
struct Placement {
  scene::PatchId patch = scene::kNone;
  PatchPart part = kWholePatch;  // a triangle for kinds l and halves, the whole patch for blocks
  PlacementKind kind = PlacementKind::color;
  // Kind block, in texels, all even. Kind l: x and y.
  uint16_t x = 0, y = 0;
  uint16_t width = 0, height = 0;
  bool transposed = false;  // the patch's u axis runs down
  bool masked = false;      // has coverage
  // Of corners 1..4 (geometry_compression::NewPatch); corner 0 has 0. Kinds l and halves: of the triangle's
  // corners 1 and 2.
  std::array<SpacingCode, 4> spacing{};
  LPlace l;            // kind l
  HalvesPlace halves;  // kind halves
  bool operator==(const Placement&) const = default;

  // Of which triangle, where it is of one.
  uint32_t triangle() const { return part - 1u; }
  // Samples in the atlas; those of a block are all its texels.
  uint64_t texels() const;
  // Without coverage; a single colour is one sample.
  uint64_t color_texels() const {
    return kind == PlacementKind::color ? 1 : masked ? texels() / 2 : texels();
  }
  // Size of the colour part, in texels; coverage has the same size.
  uint32_t color_width() const { return masked && width > height ? width / 2u : width; }
  uint32_t color_height() const { return masked && width <= height ? height / 2u : height; }
};

struct TexelRectangle {
  uint32_t x = 0, y = 0, width = 0, height = 0;
};

// Where the samples of a placement lie in an atlas of this width: rectangles that do not overlap, none for a
// single colour.
void visit_samples(const Placement& placement, uint32_t atlas_width,
                   const std::function<void(const TexelRectangle&)>& visit);

// What changed between two frames of a layout.
struct LayoutDelta {
  std::vector<Placement> changed;       // new, moved or of another size or kind; sorted by patch and part
  std::vector<scene::PatchId> removed;  // sorted: no part of them is placed any more
};

// From one list of placements to the next, both sorted by patch and part. A layout places the same parts of a
// patch as long as it is visible.
LayoutDelta difference(std::span<const Placement> before, std::span<const Placement> after);

}  // namespace tessera::atlas
