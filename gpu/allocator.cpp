#include "gpu/allocator.h"

#include <algorithm>
#include <bit>
#include <optional>
#include <utility>

namespace tessera::gpu {
namespace {

constexpr uint64_t kBlockBytes = 64ull << 20;
constexpr uint64_t kDedicatedAbove = 16ull << 20;

using Flag = vk::MemoryPropertyFlagBits;

struct Wish {
  vk::MemoryPropertyFlags required, preferred, avoided;
};

Wish wish(Memory kind, bool shares_memory) {
  const vk::MemoryPropertyFlags mapped = Flag::eHostVisible | Flag::eHostCoherent;
  switch (kind) {
    case Memory::upload:
      return {mapped, {}, Flag::eHostCached | Flag::eDeviceLocal};
    case Memory::readback:
      return {mapped, Flag::eHostCached, Flag::eDeviceLocal};
    case Memory::device:
      break;
  }
  return {
      {}, Flag::eDeviceLocal | (shares_memory ? mapped | Flag::eHostCached : vk::MemoryPropertyFlags{}), {}};
}

int score(vk::MemoryPropertyFlags flags, const Wish& wish) {
  const auto bits = [](vk::MemoryPropertyFlags f) {
    return std::popcount(static_cast<VkMemoryPropertyFlags>(f));
  };
  const int device_local = wish.preferred & flags & Flag::eDeviceLocal ? 8 : 0;
  return device_local + 2 * bits(flags & wish.preferred) - bits(flags & wish.avoided);
}

// First fit. Takes the range out of the block's free list.
std::optional<uint64_t> take(MemoryBlock& block, uint64_t bytes, uint64_t alignment) {
  for (const auto& [offset, size] : block.free) {
    const uint64_t begin = (offset + alignment - 1) / alignment * alignment;
    const uint64_t first = offset, end = offset + size;
    if (begin + bytes > end) continue;
    block.free.erase(first);
    if (begin > first) block.free[first] = begin - first;
    if (begin + bytes < end) block.free[begin + bytes] = end - begin - bytes;
    return begin;
  }
  return std::nullopt;
}

void put_back(std::map<uint64_t, uint64_t>& free, uint64_t offset, uint64_t bytes) {
  auto next = free.lower_bound(offset);
  if (next != free.end() && offset + bytes == next->first) {
    bytes += next->second;
    next = free.erase(next);
  }
  if (next != free.begin()) {
    const auto previous = std::prev(next);
    if (previous->first + previous->second == offset) {
      previous->second += bytes;
      return;
    }
  }
  free[offset] = bytes;
}

}  // namespace

Allocation& Allocation::operator=(Allocation&& other) noexcept {
  std::swap(owner_, other.owner_);
  std::swap(block_, other.block_);
  std::swap(offset_, other.offset_);
  std::swap(size_, other.size_);
  std::swap(visible_, other.visible_);
  return *this;
}

Allocation::~Allocation() {
  if (owner_ != nullptr) owner_->release(*block_, offset_, size_);
}

vk::DeviceMemory Allocation::memory() const {
  return *block_->memory;
}

std::byte* Allocation::mapped() const {
  return !visible_ || block_->mapped == nullptr ? nullptr : block_->mapped + offset_;
}

Allocator::Allocator(const vk::raii::PhysicalDevice& physical, const vk::raii::Device& device,
                     bool shares_memory)
    : device_(device),
      types_(physical.getMemoryProperties()),
      granularity_(physical.getProperties().limits.bufferImageGranularity),
      max_blocks_(physical.getProperties().limits.maxMemoryAllocationCount),
      shares_memory_(shares_memory) {}

Allocation Allocator::allocate(const vk::MemoryRequirements& requirements, Memory kind) {
  const uint32_t type = memory_type(requirements.memoryTypeBits, kind);
  // Whole granules, so that a buffer and an image never share one.
  const uint64_t alignment = std::max(requirements.alignment, granularity_);
  const uint64_t bytes = (requirements.size + granularity_ - 1) / granularity_ * granularity_;

  MemoryBlock* block = nullptr;
  std::optional<uint64_t> offset;
  if (bytes <= kDedicatedAbove) {
    for (const auto& candidate : blocks_) {
      if (candidate->dedicated || candidate->type != type) continue;
      block = candidate.get();
      if ((offset = take(*block, bytes, alignment))) break;
    }
  }
  if (!offset) {
    const bool dedicated = bytes > kDedicatedAbove;
    block = &add_block(type, dedicated ? bytes : kBlockBytes, dedicated);
    offset = take(*block, bytes, alignment);
  }
  in_use_ += bytes;
  peak_ = std::max(peak_, in_use_);
  // On a discrete GPU device-local mappable memory is slow to read; Memory::device is left unmapped there.
  const bool visible = kind != Memory::device || shares_memory_;
  return {*this, *block, *offset, bytes, visible};
}

uint32_t Allocator::memory_type(uint32_t allowed, Memory kind) const {
  const Wish wanted = wish(kind, shares_memory_);
  std::optional<uint32_t> best;
  for (uint32_t i = 0; i < types_.memoryTypeCount; ++i) {
    const vk::MemoryPropertyFlags flags = types_.memoryTypes[i].propertyFlags;
    const bool fits = (allowed >> i & 1) != 0 && (flags & wanted.required) == wanted.required &&
                      !(flags & (Flag::eProtected | Flag::eLazilyAllocated));
    if (!fits) continue;
    if (!best || score(flags, wanted) > score(types_.memoryTypes[*best].propertyFlags, wanted)) best = i;
  }
  if (!best) throw vk::FeatureNotPresentError("no memory type fits this resource");
  return *best;
}

MemoryBlock& Allocator::add_block(uint32_t type, uint64_t bytes, bool dedicated) {
  if (blocks_.size() >= max_blocks_) {
    throw vk::OutOfDeviceMemoryError("vkAllocateMemory: maxMemoryAllocationCount is reached");
  }
  vk::raii::DeviceMemory memory = device_.allocateMemory({bytes, type});
  const vk::MemoryPropertyFlags flags = types_.memoryTypes[type].propertyFlags;
  const vk::MemoryPropertyFlags mappable = Flag::eHostVisible | Flag::eHostCoherent;
  std::byte* mapped = nullptr;
  if ((flags & mappable) == mappable) mapped = static_cast<std::byte*>(memory.mapMemory(0, VK_WHOLE_SIZE));
  blocks_.push_back(std::make_unique<MemoryBlock>(
      MemoryBlock{std::move(memory), mapped, type, bytes, dedicated, {{0, bytes}}}));
  return *blocks_.back();
}

void Allocator::release(MemoryBlock& block, uint64_t offset, uint64_t size) {
  in_use_ -= size;
  put_back(block.free, offset, size);
  const bool empty = block.free.size() == 1 && block.free.begin()->second == block.bytes;
  if (empty) std::erase_if(blocks_, [&](const auto& b) { return b.get() == &block; });
}

}  // namespace tessera::gpu
