// Layout `coherent` (ours): each visible patch has a rectangle of any even sides that stays in place from
// frame to frame, with samples spaced evenly on the screen of the eye that it was placed for (TSS eq. 5, per
// corner). It keeps what the papers' layouts have apart: places that video coding likes (Shading Atlas
// Streaming), and samples where the screen has them (Tessellated Shading Streaming).
#pragma once

#include <memory>

#include "atlas/layout.h"

namespace tessera::atlas::coherent {

// A rectangle stays while it is good enough, and spacing while each corner is right within a factor of two,
// so that samples do not swim. What should be larger grows a part of the atlas a frame. When room runs out,
// the emptiest slabs are emptied into the others, a part of the atlas a frame, too.
class Layout final : public atlas::Layout {
 public:
  static StatusOr<std::unique_ptr<Layout>> create(const scene::Scene& scene, const LayoutSettings& settings);
  ~Layout() override;

  LayoutDelta update(const LayoutInput& input) override;
  std::span<const Placement> placements() const override;
  const LayoutStats& stats() const override;

 private:
  struct Impl;
  explicit Layout(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::atlas::coherent
