// The visible set of a few views: meshlet culling (frustum, then two-pass occlusion with a depth pyramid), an
// id buffer a view, and the union of what they show.
#pragma once

#include <memory>
#include <span>

#include "base/view.h"
#include "gpu/device.h"
#include "scene/gpu_scene.h"
#include "scene/visible_set.h"

namespace tessera::pvs {

struct VisibilitySettings {
  // Both off: every instance is drawn whole.
  bool frustum_culling = true;
  bool occlusion_culling = true;
  // Pixels of determine()'s id buffers per pixel of its views, along each side, 0.25 to 4. More finds more of
  // the triangles that are thinner than a pixel; odd whole numbers keep the views' pixel centres. 1 suffices
  // for predict_views(), whose views look through different points of their pixels.
  float resolution_scale = 1;
};

struct VisibilityStats {
  uint32_t views = 0;
  uint64_t meshlets_tested = 0, meshlets_drawn = 0;
  uint64_t triangles_drawn = 0;  // submitted to the rasteriser, all views
  double gpu_ms = 0;
};

// An id buffer on the CPU: per pixel the global instanced triangle id + 1 (see Instance::first_triangle), 0 =
// background.
struct IdBuffer {
  uint32_t width = 0, height = 0;
  std::vector<uint32_t> triangle_plus_one;
};

// Per session: keeps the meshlets that the last frame saw. Alpha-masked texels below the cut-off and back
// faces of single-sided materials are not drawn, exactly as in the reference renderer and on the client.
class Visibility {
 public:
  static StatusOr<std::unique_ptr<Visibility>> create(gpu::Device& device, const scene::GpuScene& scene,
                                                      const VisibilitySettings& settings);
  ~Visibility();

  // The union of the patches that the views show, with each patch's largest footprint (thesis eq. 3.1) over
  // the views' eye points. Blocks until done. `instant` must be set.
  StatusOr<scene::VisiblePatches> determine(const scene::SceneInstant& instant, std::span<const View> views,
                                            const View& client_view);
  // One view's id buffer (for coverage, holes, tests).
  StatusOr<IdBuffer> render_ids(const scene::SceneInstant& instant, const View& view);
  const VisibilityStats& stats() const;  // of the last determine() or render_ids()

 private:
  struct Impl;
  explicit Visibility(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

// The patch of each instanced triangle: maps ids of an IdBuffer to patches.
class TriangleToPatch {
 public:
  explicit TriangleToPatch(const scene::Scene& scene);
  scene::PatchId operator[](uint32_t instanced_triangle) const { return patch_[instanced_triangle]; }

 private:
  std::vector<scene::PatchId> patch_;
};

// Footprint of a patch seen from `eye` (thesis eq. 3.1, by atan2 instead of acos; area by the cross product
// of the angular edges). `transform` = world matrix of its instance. Valid for any finite input, the eye in
// the patch included.
scene::Footprint footprint(const scene::Geometry& geometry, const scene::Patch& patch, const dmat4& transform,
                           const dvec3& eye, float pixels_per_radian);

}  // namespace tessera::pvs
