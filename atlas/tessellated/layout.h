// Layout `tessellated` (Tessellated Shading Streaming): each triangle by itself, with samples where the
// tessellator would set them, folded into an L, or, if it is slanted, as two right-angled staircases.
#pragma once

#include <memory>

#include "atlas/layout.h"

namespace tessera::atlas::tessellated {

// As in the paper nothing stays from frame to frame, so most places change in each. Levels beyond the highest
// are reached by splitting. The least bias is taken at which all fits; what still finds no room gets a single
// colour.
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

}  // namespace tessera::atlas::tessellated
