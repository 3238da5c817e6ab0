// Shades the samples of placed patches into the atlas image (the gather), on paths with the same result: one
// invocation a sample in compute, raster rectangles, or the tessellation stages. Which is cheapest depends on
// shape, size and device.
#pragma once

#include <memory>
#include <span>

#include "atlas/placement.h"
#include "base/view.h"
#include "gpu/image.h"
#include "scene/gpu_scene.h"
#include "shading/gather_choice.h"
#include "shading/lighting.h"

namespace tessera::shading {

struct GatherSettings {
  uint32_t width = 2048, height = 1024;     // of the atlas
  GatherPath path = GatherPath::automatic;  // automatic: as `choice` says
  GatherChoice choice = software_choice();
};

struct GatherStats {
  uint64_t samples = 0;               // filled; what lies twice in an L is shaded once by tessellation
  uint64_t color_samples = 0;         // single colours among them
  uint64_t half_samples = 0;          // of halves (Oversampling) among them
  uint64_t half_samples_outside = 0;  // and of those, outside their triangles
  uint64_t raster_blocks = 0, compute_blocks = 0;
  uint64_t tessellated_blocks = 0;  // triangles that went to the tessellator
  double list_ms = 0;               // on the CPU: work lists and start tables made and written
  double gpu_ms = 0;
};

// Per session. The atlas image is sRGB-encoded RGBA8 (alpha 255 in used texels); texels that nothing uses
// keep the colour that they had (a still image costs a video coder nothing), mid-grey at first.
class Gather {
 public:
  // FailedPrecondition where a path is tessellation and the device cannot do it.
  static StatusOr<std::unique_ptr<Gather>> create(gpu::Device& device, const scene::GpuScene& scene,
                                                  const Lighting& lighting, const GatherSettings& settings);
  ~Gather();

  // For what is recorded from now on. Makes the pipelines that it needs and that were not needed before;
  // FailedPrecondition as in create().
  Status choose(const GatherChoice& choice);
  // Shades all `placements` as seen by `viewer`: from its eye, with textures filtered for its pixels or for
  // the texels, whichever are wider. Records into `commands`, as the interval "gather" (so not within another
  // interval) and with a barrier at its end; the same Gather must not be recorded again before that work is
  // done. Masked patches also get their coverage half.
  Status record(gpu::Commands& commands, const scene::SceneInstant& instant, const View& viewer,
                std::span<const atlas::Placement> placements);
  // After that work is done: sRGB colours of the placements of kind color, in the order of `placements` of
  // record(), 0xBBGGRR.
  std::span<const uint32_t> colors() const;
  const gpu::Image& image() const;
  const GatherStats& stats() const;

 private:
  struct Impl;
  explicit Gather(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::shading
