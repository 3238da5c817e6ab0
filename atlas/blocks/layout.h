// Layout `blocks` (Shading Atlas Streaming): visible patches → placements, kept in place from frame to frame.
#pragma once

#include <memory>
#include <span>

#include "atlas/level_selection.h"
#include "atlas/placement.h"
#include "base/status.h"
#include "scene/visible_set.h"

namespace tessera::atlas::blocks {

struct LayoutSettings {
  uint32_t width = 2048, height = 1024;  // texels, multiples of the superblock's side, at most 8192
  uint8_t superblock_log = 8;
  float high_water = 0.96f;  // share of superblocks in use above which the atlas is reset
  LevelSettings levels;
};

// Settings for an atlas of this size: the largest superblocks, up to 256 texels a side, of which there are at
// least 64. Each block width in use holds a superblock of its own, so fewer would starve patches long before
// the atlas is full.
LayoutSettings settings_for(uint32_t width, uint32_t height);

struct LayoutStats {
  float bias = 0;
  double target_share = 0;
  double ideal_texels = 0;
  uint64_t used_texels = 0;   // in blocks
  uint64_t stack_texels = 0;  // fragmented
  uint32_t blocks = 0, colors = 0, colors_out_of_memory = 0;
  uint32_t changed = 0, removed = 0;
  bool reset = false;  // this frame re-placed everything, or a stage of it
  uint32_t resets_total = 0;
};

// Per session. Not thread-safe.
class Layout {
 public:
  // InvalidArgument if the size does not fit the superblocks. `scene` gives the patches' traits.
  static StatusOr<std::unique_ptr<Layout>> create(const scene::Scene& scene, const LayoutSettings& settings);
  ~Layout();

  // Places the visible set. Patches that stay visible at their level keep their block. When memory runs out a
  // patch falls back to a single colour and the next frames re-place the atlas in stages (a share of the
  // superblocks a frame).
  LayoutDelta update(const scene::VisiblePatches& visible);
  // All current placements, sorted by patch. Valid until the next update.
  std::span<const Placement> placements() const;
  const LayoutStats& stats() const;
  const LayoutSettings& settings() const;

 private:
  struct Impl;
  explicit Layout(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::atlas::blocks
