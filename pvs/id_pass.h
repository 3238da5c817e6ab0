// Draws triangle ids and depth of a view.
#pragma once

#include "base/view.h"
#include "gpu/commands.h"
#include "gpu/image.h"
#include "gpu/pipeline.h"
#include "pvs/buckets.h"
#include "pvs/culling.h"
#include "scene/gpu_scene.h"

namespace tessera::pvs {

class IdPass {
 public:
  // Pipelines for masked materials exist only if the scene has some.
  static StatusOr<IdPass> create(gpu::Device& device, const scene::GpuScene& scene);

  // Makes the targets at least this large; true if they are new. No device work may be under way.
  StatusOr<bool> reserve(uint32_t width, uint32_t height);
  const gpu::Image& ids() const { return ids_; }
  const gpu::Image& depth() const { return depth_; }
  uint64_t id_bytes() const { return uint64_t{sizeof(uint32_t)} * ids_.width() * ids_.height(); }

  // The lists that `culling` made last; `clear` starts a new view. Leaves a barrier behind.
  void record(gpu::Commands& commands, const scene::SceneInstant& instant, const View& view,
              const BucketTable& buckets, const MeshletCulling& culling, bool clear) const;
  // Everything, instance by instance. Leaves a barrier behind.
  void record_all(gpu::Commands& commands, const scene::SceneInstant& instant, const View& view,
                  const BucketTable& buckets) const;
  // Draws at most one triangle with each pipeline, so that the driver compiles them now.
  void record_warm_up(gpu::Commands& commands, const scene::SceneInstant& instant, const View& view) const;

 private:
  IdPass() = default;
  const gpu::RasterPipeline& pipeline(bool masked) const { return masked ? masked_ : opaque_; }
  void begin(gpu::Commands& commands, const View& view, bool clear) const;
  void bind(gpu::Commands& commands, const scene::SceneInstant& instant, const View& view,
            const BucketState& state) const;

  gpu::Device* device_ = nullptr;
  const scene::GpuScene* scene_ = nullptr;
  gpu::Image ids_, depth_;
  gpu::RasterPipeline opaque_, masked_;
};

}  // namespace tessera::pvs
