// The product's chain, one step at a time, for the stability catalogue: visible set, layout, gather, meta
// packet, client; beside the forward reference renderer.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "atlas/layout.h"
#include "bench/stability.h"
#include "client-sdk/display.h"
#include "client-sdk/meta_checker.h"
#include "client-sdk/scene_store.h"
#include "pvs/visibility.h"
#include "server/meta_builder.h"
#include "server/shared_scene.h"
#include "shading/gather.h"
#include "shading/reference.h"

namespace tessera::bench {

// A square one of 90 degrees.
View stability_view(uint32_t side, const dvec3& eye = dvec3(0));

// A scene on the device, and its truth.
class StabilityScene {
 public:
  static StatusOr<std::unique_ptr<StabilityScene>> create(const StabilityContext& context,
                                                          std::shared_ptr<const scene::Scene> scene);

  server::SharedScene& shared() { return *shared_; }
  // The scene relative to the eye of the last view that was asked for.
  const scene::SceneInstant& instant() const { return *instant_; }
  StatusOr<shading::ReferenceImage> truth(const View& view);
  StatusOr<scene::VisiblePatches> visible(const View& view);
  // Sets instant() and the lights, which the others do, too.
  Status look_from(const View& view);

 private:
  std::shared_ptr<server::SharedScene> shared_;
  std::unique_ptr<scene::SceneInstant> instant_;
  std::unique_ptr<shading::ReferenceRenderer> reference_;
  std::unique_ptr<pvs::Visibility> visibility_;
};

// A session's stages with one layout, and the client that it serves.
class StabilityChain {
 public:
  // `scene` outlives it.
  static StatusOr<std::unique_ptr<StabilityChain>> create(StabilityScene& scene,
                                                          const atlas::LayoutSettings& layout, uint32_t side);

  // The next frame, placed by the layout.
  Status serve(const View& view);
  // The next frame, placed by hand; sorted by patch and part.
  Status serve(const View& view, std::vector<atlas::Placement> placements);
  // The client's picture; Internal if its records are not what the server placed.
  StatusOr<Image8> draw(const View& view);

  std::span<const atlas::Placement> placements() const { return placements_; }
  const atlas::LayoutStats& stats() const { return layout_->stats(); }

 private:
  StabilityChain(StabilityScene& scene, const atlas::LayoutSettings& settings)
      : scene_(scene), settings_(settings) {}
  Status shade_and_send(const View& view, const atlas::LayoutDelta& delta);

  StabilityScene& scene_;
  const atlas::LayoutSettings settings_;
  std::unique_ptr<atlas::Layout> layout_;
  std::unique_ptr<shading::Gather> gather_;
  std::unique_ptr<server::MetaBuilder> meta_;
  gpu::Buffer readback_;
  std::vector<atlas::Placement> placements_;
  FrameNumber next_ = 0;
  client::MetaChecker checker_;
  client::SceneStore store_;
  std::unique_ptr<client::Display> display_;
};

struct PictureErrors {
  double color = 0;  // largest difference of a channel, in the interior: where the truth is all geometry, and
                     // around it
  double holes = 0;  // share of the samples there that the client leaves to the background
  double outline = 0;  // share of all pixels that are elsewhere, and that truth and client cover differently
  double covered = 0;  // share of all pixels that are interior
};
// Of scenes coloured as StabilityMesh has it.
PictureErrors compare_pictures(const shading::ReferenceImage& truth, const Image8& shown);
// The worst of both.
PictureErrors worst(const PictureErrors& a, const PictureErrors& b);

struct PictureBounds {
  double color = 0;
  std::string why;
  double holes = 0;
  double outline = 0.01;  // where the edge of the whole moves by the step of positions a sample may flip
  std::string holes_why = "patches share their corners at the client, too";
  bool may_show_nothing = false;
};

constexpr std::array kAllLayouts{atlas::LayoutKind::blocks, atlas::LayoutKind::coherent,
                                 atlas::LayoutKind::tessellated};

// Draws the scene with each of the layouts, from each of the views in turn, one session each.
StatusOr<std::vector<StabilityMeasure>> measure_pictures(
    const StabilityContext& context, std::shared_ptr<const scene::Scene> scene, std::span<const View> views,
    const PictureBounds& bounds, std::span<const atlas::LayoutKind> layouts = kAllLayouts);
// As rows of the case, e.g. "colour, blocks".
void add_measures(const std::string& suffix, const PictureErrors& errors, const PictureBounds& bounds,
                  std::vector<StabilityMeasure>& measures);

}  // namespace tessera::bench
