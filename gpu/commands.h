// Records one submission. Cheap to move; obtained from Device::begin().
//
// Ordering: passes are independent unless barrier() stands between them. A submission ends with one.
//
// Errors: the first mistake (a range outside a buffer, an unset binding) is kept, what follows it is not
// recorded, and Device::submit returns it.
#pragma once

#include <array>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <optional>
#include <span>
#include <string_view>

#include "gpu/buffer.h"
#include "gpu/image.h"
#include "gpu/pipeline.h"

namespace tessera::gpu {

struct ColorAttachment {
  const Image* image = nullptr;
  std::optional<std::array<uint32_t, 4>> clear_uint;  // for integer formats
  std::optional<std::array<float, 4>> clear;          // for the others; neither = keep the contents
  const Image* resolve = nullptr;                     // multisampled image: averaged into this one
};

struct RenderTarget {
  std::span<const ColorAttachment> colors;
  const Image* depth = nullptr;
  bool clear_depth = true;  // to 0, the far end
  uint32_t width = 0, height = 0;
};

class Commands {
 public:
  struct Impl;
  explicit Commands(std::unique_ptr<Impl> impl);
  Commands(Commands&&) noexcept;
  Commands& operator=(Commands&&) noexcept;
  ~Commands();

  // Names the GPU time from here to end_interval() (not nested).
  void begin_interval(std::string_view name);
  void end_interval();

  // Everything recorded before is finished and visible to everything after, the CPU included.
  void barrier();

  // Compute. Bind pipeline first; `groups[i]` is set i; push constants are copied.
  void bind(const ComputePipeline& pipeline, std::initializer_list<const BindGroup*> groups);
  void dispatch(uint32_t x, uint32_t y = 1, uint32_t z = 1);

  // Raster and tessellation, between begin_rendering and end_rendering. The viewport covers the target
  // (negative height: +Y up). Tessellation alone needs no attachments.
  void begin_rendering(const RenderTarget& target);
  void end_rendering();
  void bind(const RasterPipeline& pipeline, std::initializer_list<const BindGroup*> groups);
  // Of its draws, keep each below about 32,000 points: old lavapipe slows down beyond.
  void bind(const TessellationPipeline& pipeline, std::initializer_list<const BindGroup*> groups);
  void set_cull(Cull cull);
  void set_viewport(uint32_t x, uint32_t y, uint32_t width, uint32_t height);  // viewport and scissor
  void bind_indices(const Buffer& buffer);                                     // uint32
  void draw(uint32_t vertices, uint32_t instances = 1, uint32_t first_vertex = 0,
            uint32_t first_instance = 0);
  void draw_indexed(uint32_t indices, uint32_t instances, uint32_t first_index, int32_t vertex_offset,
                    uint32_t first_instance);
  // VkDrawIndexedIndirectCommand[] at `offset` in `buffer`, their number (uint32, <= max_draws) at
  // `count_offset` in `count`.
  void draw_indexed_indirect_count(const Buffer& buffer, uint64_t offset, const Buffer& count,
                                   uint64_t count_offset, uint32_t max_draws);

  // All kinds of pipeline. `T` is a plain struct of at most 128 bytes.
  template <class T>
  void push(const T& value) {
    push_bytes(std::as_bytes(std::span(&value, 1)));
  }
  void push_bytes(std::span<const std::byte> bytes);

  // Transfers.
  void copy(const Buffer& from, uint64_t from_offset, const Buffer& to, uint64_t to_offset, uint64_t bytes);
  void fill(const Buffer& buffer, uint32_t word, uint64_t offset = 0, uint64_t bytes = ~0ull);
  void clear(const Image& image, std::array<float, 4> color);
  // Tightly packed rows; one mip level of one layer.
  void copy_to_image(const Buffer& from, uint64_t offset, const Image& to, uint32_t mip = 0,
                     uint32_t layer = 0);
  void copy_to_buffer(const Image& from, const Buffer& to, uint64_t offset = 0, uint32_t mip = 0,
                      uint32_t layer = 0);
  // Box-filters mip 0 down the chain, all layers (sRGB formats filter in linear light).
  void generate_mips(const Image& image);

  Impl& impl() { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::gpu
