// A mapped buffer that grows with what is written to it.
#pragma once

#include <algorithm>
#include <cstring>
#include <span>
#include <string_view>

#include "gpu/buffer.h"

namespace tessera::shading {

// Of a buffer of `size` that needs `bytes`: twice as many as before, so that it seldom grows, but no more
// than a binding may span (`most`), unless they are needed.
inline uint64_t grown_size(uint64_t size, uint64_t bytes, uint64_t most) {
  return std::max<uint64_t>({256, bytes, std::min(2 * size, most)});
}

// Makes `buffer` hold at least `bytes` (never 0: a binding needs something). True if it is a new one, to be
// bound again. The old one must not be in use.
inline StatusOr<bool> grow(gpu::Device& device, gpu::Buffer& buffer, uint64_t bytes, gpu::Memory memory,
                           std::string_view name) {
  if (buffer.size() >= std::max<uint64_t>(bytes, 1)) return false;
  const uint64_t wanted = grown_size(buffer.size(), bytes, device.info().max_storage_buffer_range);
  TESSERA_ASSIGN_OR_RETURN(buffer, gpu::Buffer::create(device, wanted, memory, name));
  return true;
}

template <class T>
void write(gpu::Buffer& buffer, std::span<const T> values, uint64_t offset = 0) {
  if (!values.empty()) std::memcpy(buffer.mapped() + offset, values.data(), values.size_bytes());
}

}  // namespace tessera::shading
