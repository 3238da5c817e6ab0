// Descriptor set 3 of the shading passes, one group a material: binding 0 is the material's record as a
// uniform buffer, the others are the pass's own. All samples of a draw or dispatch have one material; on the
// software device a load from a uniform buffer costs a tenth of one from the scene's storage buffer
// (measured: a third of a frame's time).
#pragma once

#include <span>
#include <vector>

#include "gpu/pipeline.h"
#include "scene/gpu_scene.h"

namespace tessera::shading {

class MaterialGroups {
 public:
  // `bindings`: the pass's own, from index 1. Blocks.
  static StatusOr<MaterialGroups> create(gpu::Device& device, const scene::GpuScene& scene,
                                         std::span<const gpu::Binding> bindings);

  // In every group.
  void set(uint32_t binding, const gpu::Buffer& buffer);
  void set(uint32_t binding, const gpu::Image& image);

  const gpu::BindLayout& layout() const { return layout_; }
  const gpu::BindGroup& of(uint32_t material) const { return groups_[material]; }

 private:
  gpu::BindLayout layout_;
  std::vector<gpu::Buffer> records_;
  std::vector<gpu::BindGroup> groups_;
};

}  // namespace tessera::shading
