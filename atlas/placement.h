// Where a patch's samples lie. The one vocabulary between atlas/, shading/, the wire and the client.
#pragma once

#include <cstdint>
#include <vector>

#include "scene/scene.h"

namespace tessera::atlas {

// Binary logarithms of a block's sides in texels; width >= height; kMinLog..log2(superblock side).
struct Level {
  uint8_t log_w = 0, log_h = 0;
  bool operator==(const Level&) const = default;
};
constexpr uint8_t kMinLog = 1;  // 2 texels: a block owns its 4:2:0 chroma samples

enum class PlacementKind : uint8_t {
  block,  // a rectangle of the atlas
  color,  // one colour for the whole patch, sent beside the video: it is small, or the atlas is full
};

// Within a block, corner c of the patch (scene::patch_corner) lies at the centre of texel
//   x + round(c.u * (width - 1)), y + round(c.v * (height - 1))      (u and v swapped if transposed)
// so that a bilinear fetch never leaves the block (half-texel inset, thesis fig. 3.4).
// A masked patch's block is split in halves: left and right if it is wider than high, else upper and lower.
// Colour lies in the first half, coverage as grey in the second; the map above then holds for the colour
// half.
struct Placement {
  scene::PatchId patch = scene::kNone;
  PlacementKind kind = PlacementKind::color;
  Level level;              // kind block
  uint16_t x = 0, y = 0;    // kind block: texels, even
  bool transposed = false;  // the patch's u axis runs down
  bool masked = false;      // has coverage
  bool operator==(const Placement&) const = default;

  uint32_t width() const { return 1u << level.log_w; }
  uint32_t height() const { return 1u << level.log_h; }
  // Size of the colour part, in texels; coverage has the same size.
  uint32_t color_width() const { return masked && level.log_w > level.log_h ? width() / 2 : width(); }
  uint32_t color_height() const { return masked && level.log_w == level.log_h ? height() / 2 : height(); }
};

// What changed between two frames of a layout.
struct LayoutDelta {
  std::vector<Placement> changed;       // new, moved or of another level or kind; sorted by patch
  std::vector<scene::PatchId> removed;  // sorted
};

}  // namespace tessera::atlas
