// Linear GPU memory.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>

#include "base/status.h"
#include "gpu/device.h"

namespace tessera::gpu {

enum class Memory {
  device,    // fast for the GPU; not mapped unless the device shares its memory with the CPU
  upload,    // mapped; written by the CPU in order, read by the GPU
  readback,  // mapped and cached; written by the GPU, read by the CPU
};

// May be bound as storage, uniform, index or indirect buffer and copied in both directions. Contents start as
// zeros. A size of 0 is allowed, so that empty arrays need no special case. Move-only; destruction must wait
// for the work that uses it (see Device::submit).
class Buffer {
 public:
  static StatusOr<Buffer> create(Device& device, uint64_t bytes, Memory memory, std::string_view name);
  // Memory::device, filled with `data` through a staging copy (blocks).
  static StatusOr<Buffer> create_filled(Device& device, std::span<const std::byte> data,
                                        std::string_view name);
  Buffer();  // empty: size() == 0
  Buffer(Buffer&&) noexcept;
  Buffer& operator=(Buffer&&) noexcept;
  ~Buffer();

  uint64_t size() const { return size_; }
  // Coherent mapping, or nullptr where the memory cannot be mapped (Memory::device on most GPUs).
  std::byte* mapped() const { return mapped_; }
  template <class T>
  std::span<T> as() const {
    return {reinterpret_cast<T*>(mapped_), mapped_ ? size_ / sizeof(T) : 0};
  }

  struct Impl;
  Impl& impl() const { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
  uint64_t size_ = 0;
  std::byte* mapped_ = nullptr;
};

}  // namespace tessera::gpu
