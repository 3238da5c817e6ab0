// Private to gpu/. Device memory, cut from blocks so that many small resources stay below
// maxMemoryAllocationCount.
#pragma once

#include <map>
#include <memory>
#include <vector>
#include <vulkan/vulkan_raii.hpp>

#include "gpu/buffer.h"

namespace tessera::gpu {

class Allocator;
struct MemoryBlock;

// A range of device memory; gives itself back. The Allocator must outlive it.
class Allocation {
 public:
  Allocation() = default;
  Allocation(Allocator& owner, MemoryBlock& block, uint64_t offset, uint64_t size, bool visible)
      : owner_(&owner), block_(&block), offset_(offset), size_(size), visible_(visible) {}
  Allocation(Allocation&& other) noexcept { *this = std::move(other); }
  Allocation& operator=(Allocation&& other) noexcept;
  ~Allocation();

  vk::DeviceMemory memory() const;
  uint64_t offset() const { return offset_; }
  std::byte* mapped() const;  // nullptr where the CPU cannot see the memory

 private:
  Allocator* owner_ = nullptr;
  MemoryBlock* block_ = nullptr;
  uint64_t offset_ = 0, size_ = 0;
  bool visible_ = false;
};

// One vkAllocateMemory, and which of its ranges are free (offset -> bytes; neighbours are always merged).
struct MemoryBlock {
  vk::raii::DeviceMemory memory;
  std::byte* mapped;
  uint32_t type;
  uint64_t bytes;
  bool dedicated;
  std::map<uint64_t, uint64_t> free;
};

class Allocator {
 public:
  // `shares_memory`: the CPU and the device use the same memory (software and integrated devices), so that
  // Memory::device is mapped too.
  Allocator(const vk::raii::PhysicalDevice& physical, const vk::raii::Device& device, bool shares_memory);

  // Throws vk::SystemError when the device has no memory left.
  Allocation allocate(const vk::MemoryRequirements& requirements, Memory kind);

  uint64_t in_use() const { return in_use_; }
  uint64_t peak() const { return peak_; }

 private:
  friend class Allocation;
  uint32_t memory_type(uint32_t allowed, Memory kind) const;
  MemoryBlock& add_block(uint32_t type, uint64_t bytes, bool dedicated);
  void release(MemoryBlock& block, uint64_t offset, uint64_t size);

  const vk::raii::Device& device_;
  vk::PhysicalDeviceMemoryProperties types_;
  uint64_t granularity_;
  uint32_t max_blocks_;
  bool shares_memory_;
  std::vector<std::unique_ptr<MemoryBlock>> blocks_;
  uint64_t in_use_ = 0, peak_ = 0;
};

}  // namespace tessera::gpu
