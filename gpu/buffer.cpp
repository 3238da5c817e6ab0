#include "gpu/buffer.h"

#include <algorithm>
#include <cstring>

#include "gpu/impl.h"

namespace tessera::gpu {
namespace {

constexpr vk::BufferUsageFlags kUsage =
    vk::BufferUsageFlagBits::eStorageBuffer | vk::BufferUsageFlagBits::eUniformBuffer |
    vk::BufferUsageFlagBits::eIndexBuffer | vk::BufferUsageFlagBits::eIndirectBuffer |
    vk::BufferUsageFlagBits::eTransferSrc | vk::BufferUsageFlagBits::eTransferDst;

// Vulkan has no empty buffers, and fills whole words.
uint64_t allocated_size(uint64_t bytes) {
  return std::max<uint64_t>(16, (bytes + 3) / 4 * 4);
}

}  // namespace

StatusOr<Buffer> Buffer::create(Device& device, uint64_t bytes, Memory memory, std::string_view name) {
  auto created = guarded([&]() -> StatusOr<Buffer> {
    Buffer buffer;
    buffer.impl_ = std::make_unique<Impl>();
    Impl& impl = *buffer.impl_;
    impl.core = device.impl().core();
    impl.name = name;
    const uint64_t allocated = allocated_size(bytes);
    impl.buffer = impl.core->device.createBuffer({{}, allocated, kUsage});
    impl.memory = impl.core->allocator->allocate(impl.buffer.getMemoryRequirements(), memory);
    impl.buffer.bindMemory(impl.memory.memory(), impl.memory.offset());
    impl.core->set_name(*impl.buffer, name);
    buffer.size_ = bytes;
    buffer.mapped_ = impl.memory.mapped();
    if (buffer.mapped_ != nullptr) {
      std::memset(buffer.mapped_, 0, allocated);
    } else {
      impl.core->new_buffers.push_back(*impl.buffer);
    }
    return buffer;
  });
  if (created.ok()) return created;
  return with_context(created.status(),
                      absl::StrCat("buffer `", std::string(name), "` of ", bytes, " bytes"));
}

StatusOr<Buffer> Buffer::create_filled(Device& device, std::span<const std::byte> data,
                                       std::string_view name) {
  TESSERA_ASSIGN_OR_RETURN(Buffer buffer, create(device, data.size(), Memory::device, name));
  if (data.empty()) return buffer;
  if (buffer.mapped() != nullptr) {
    std::memcpy(buffer.mapped(), data.data(), data.size());
    return buffer;
  }
  TESSERA_ASSIGN_OR_RETURN(const Buffer staging, create(device, data.size(), Memory::upload, name));
  std::memcpy(staging.mapped(), data.data(), data.size());
  Commands commands = device.begin();
  commands.copy(staging, 0, buffer, 0, data.size());
  TESSERA_RETURN_IF_ERROR(device.run(std::move(commands)));
  return buffer;
}

Buffer::Impl::~Impl() {
  if (core) std::erase(core->new_buffers, *buffer);
}

Buffer::Buffer() = default;
Buffer::Buffer(Buffer&& other) noexcept {
  *this = std::move(other);
}
Buffer::~Buffer() = default;

Buffer& Buffer::operator=(Buffer&& other) noexcept {
  impl_ = std::move(other.impl_);
  size_ = std::exchange(other.size_, 0);
  mapped_ = std::exchange(other.mapped_, nullptr);
  return *this;
}

}  // namespace tessera::gpu
