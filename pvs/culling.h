// Meshlet culling on the device: which meshlets of the scene a view has to draw, as lists of draw commands by
// bucket. Two phases a view: first what the last view saw; then, with the depth of that in a pyramid,
// whatever else it does not hide. Each phase leaves its lists in draws() and counts(), for draw calls right
// after it.
#pragma once

#include <memory>

#include "base/view.h"
#include "gpu/buffer.h"
#include "gpu/commands.h"
#include "gpu/image.h"
#include "gpu/pipeline.h"
#include "pvs/buckets.h"
#include "pvs/visibility.h"
#include "scene/gpu_scene.h"

namespace tessera::pvs {

enum class CullPhase { first, second };

// What a phase drew, as the device writes it: pvs/shaders/visibility.glsl.
struct CullCounts {
  std::array<uint32_t, kBuckets> draws;
  uint32_t meshlets, triangles;
};
static_assert(sizeof(CullCounts) == 32);

class MeshletCulling {
 public:
  static StatusOr<MeshletCulling> create(gpu::Device& device, const scene::GpuScene& scene,
                                         const VisibilitySettings& settings);

  // The depth buffer that record_pyramid() reads. Again whenever it is replaced. No device work may be under
  // way.
  Status set_depth(const gpu::Image& depth);
  // No device work may be under way.
  void set_buckets(const BucketTable& buckets);

  // True if views are drawn in two phases.
  bool has_second_phase() const { return settings_.occlusion_culling; }
  // Recorders leave a barrier behind themselves.
  void record_cull(gpu::Commands& commands, const scene::SceneInstant& instant, const View& view,
                   CullPhase phase) const;
  void record_pyramid(gpu::Commands& commands, const scene::SceneInstant& instant, const View& view) const;

  const gpu::Buffer& draws() const { return draws_; }
  const gpu::Buffer& counts() const { return counts_; }
  static uint64_t draw_offset(uint32_t draw) { return uint64_t{5 * sizeof(uint32_t)} * draw; }
  static uint64_t count_offset(uint32_t bucket) { return sizeof(uint32_t) * bucket; }

 private:
  MeshletCulling() = default;
  Status create_buffers();
  Status create_pipelines();

  gpu::Device* device_ = nullptr;
  const scene::GpuScene* scene_ = nullptr;
  VisibilitySettings settings_;
  uint32_t meshlets_ = 0;
  std::array<uint32_t, kBuckets> first_draw_{};
  gpu::Buffer buckets_, was_visible_, survivors_, group_counts_, draws_, counts_, pyramid_, bounds_;
  gpu::Sampler sampler_;
  gpu::BindLayout layout_;
  gpu::BindGroup group_;
  gpu::ComputePipeline cull_, compact_, pyramid_pass_;
};

}  // namespace tessera::pvs
