// Layout `blocks` (Shading Atlas Streaming): visible patches → placements, kept in place from frame to frame.
#pragma once

#include <memory>

#include "atlas/blocks/allocator.h"
#include "atlas/layout.h"

namespace tessera::atlas::blocks {

// Settings for an atlas of this size: the largest superblocks, up to 256 texels a side, of which there are at
// least 128. Each block width in use holds a superblock of its own, so fewer would starve patches long before
// the atlas is full.
LayoutSettings settings_for(uint32_t width, uint32_t height);

// A patch that finds no block of its level takes a smaller one, then a colour. When memory runs out, the next
// frames re-place the atlas in stages (a share of the superblocks a frame).
class Layout final : public atlas::Layout {
 public:
  // InvalidArgument if the size does not fit the superblocks. `scene` gives the patches' traits. Strategies
  // other than the reference are for comparison.
  static StatusOr<std::unique_ptr<Layout>> create(const scene::Scene& scene, const LayoutSettings& settings,
                                                  Strategy strategy = Strategy::reference);
  ~Layout() override;

  LayoutDelta update(const LayoutInput& input) override;
  std::span<const Placement> placements() const override;
  const LayoutStats& stats() const override;
  AllocatorStats memory() const;  // where the atlas's texels are

 private:
  struct Impl;
  explicit Layout(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::atlas::blocks
