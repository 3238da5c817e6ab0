// What a pass binds (BindLayout, BindGroup) and how it runs (ComputePipeline, RasterPipeline,
// TessellationPipeline).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/status.h"
#include "gpu/buffer.h"
#include "gpu/device.h"
#include "gpu/image.h"

namespace tessera::gpu {

enum class BindingKind { storage_buffer, uniform_buffer, storage_image, sampled_image /* image + sampler */ };

struct Binding {
  uint32_t index;
  BindingKind kind;
  uint32_t count = 1;
};

// One descriptor set's shape. Visible to all stages.
class BindLayout {
 public:
  static StatusOr<BindLayout> create(Device& device, std::span<const Binding> bindings);
  BindLayout();
  BindLayout(BindLayout&&) noexcept;
  BindLayout& operator=(BindLayout&&) noexcept;
  ~BindLayout();

  struct Impl;
  Impl& impl() const { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

// One descriptor set. Every binding must be set before use: an unwritten one crashes old lavapipe, so
// Commands::bind refuses it. Not to be changed while submitted work uses it.
class BindGroup {
 public:
  static StatusOr<BindGroup> create(Device& device, const BindLayout& layout);
  BindGroup();
  BindGroup(BindGroup&&) noexcept;
  BindGroup& operator=(BindGroup&&) noexcept;
  ~BindGroup();

  void set(uint32_t binding, const Buffer& buffer);
  void set(uint32_t binding, const Image& image);  // storage image: mip 0, all layers
  void set(uint32_t binding, const Image& image, const Sampler& sampler, uint32_t array_element = 0);
  // Only mip level `mip` of the image, as storage image (depth pyramids).
  void set_mip(uint32_t binding, const Image& image, uint32_t mip, uint32_t array_element = 0);

  struct Impl;
  Impl& impl() const { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

using Spirv = std::span<const uint32_t>;

// A specialization constant; float and bool go in by bit pattern / 0 or 1.
struct Constant {
  uint32_t id;
  uint32_t value;
};

// `layouts[i]` is descriptor set i. `push_bytes` <= 128, visible to all stages.
struct ComputePipelineDesc {
  std::string name;
  Spirv shader;
  std::vector<const BindLayout*> layouts;
  uint32_t push_bytes = 0;
  std::vector<Constant> constants;
};

class ComputePipeline {
 public:
  static StatusOr<ComputePipeline> create(Device& device, const ComputePipelineDesc& desc);
  ComputePipeline();
  ComputePipeline(ComputePipeline&&) noexcept;
  ComputePipeline& operator=(ComputePipeline&&) noexcept;
  ~ComputePipeline();

  struct Impl;
  Impl& impl() const { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

enum class Cull { none, back, front };

// Triangles; front faces are counter-clockwise as seen with +Y up. Depth is reversed: nearer is greater, the
// test is GREATER_OR_EQUAL. No vertex buffers: shaders pull from storage buffers. No blending.
struct RasterPipelineDesc {
  std::string name;
  Spirv vertex;
  Spirv fragment;  // empty = depth only
  std::vector<const BindLayout*> layouts;
  uint32_t push_bytes = 0;
  std::vector<Constant> constants;
  std::vector<Format> colors;
  std::optional<Format> depth;
  bool depth_write = true;
  Cull cull = Cull::none;  // the initial state; Commands::set_cull changes it
  uint32_t samples = 1;
  bool sample_shading = false;  // run the fragment shader once a sample
  bool depth_clamp = false;
  float depth_bias = 0, depth_bias_slope = 0;
};

class RasterPipeline {
 public:
  static StatusOr<RasterPipeline> create(Device& device, const RasterPipelineDesc& desc);
  RasterPipeline();
  RasterPipeline(RasterPipeline&&) noexcept;
  RasterPipeline& operator=(RasterPipeline&&) noexcept;
  ~RasterPipeline();

  struct Impl;
  Impl& impl() const { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

// The tessellator as a generator of work: every vertex of a draw is a patch of its own, the control shader
// sets its levels, and each point that the tessellator makes of it (point_mode) is an invocation of the
// evaluation shader, which stores its result into buffers or images. Nothing is rasterised: it writes no
// gl_Position. gl_PrimitiveID is not to be relied on, since old lavapipe restarts it: pass gl_VertexIndex on.
struct TessellationPipelineDesc {
  std::string name;
  Spirv vertex;
  Spirv control;
  Spirv evaluation;
  std::vector<const BindLayout*> layouts;
  uint32_t push_bytes = 0;
  std::vector<Constant> constants;
};

// FailedPrecondition where DeviceInfo::tessellation_stores is false.
class TessellationPipeline {
 public:
  static StatusOr<TessellationPipeline> create(Device& device, const TessellationPipelineDesc& desc);
  TessellationPipeline();
  TessellationPipeline(TessellationPipeline&&) noexcept;
  TessellationPipeline& operator=(TessellationPipeline&&) noexcept;
  ~TessellationPipeline();

  struct Impl;
  Impl& impl() const { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::gpu
