// A large array that shaders read by index: rows of a texture, because GLES 3.0 has no storage buffers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "client-sdk/gles/gl.h"

namespace tessera::client::gles {

// How one texel of the table is stored.
struct TexelFormat {
  GLint internal_format;
  GLenum format, type;
  size_t bytes;
};

class TableTexture {
 public:
  // Entry i lies at (i % kWidth, i / kWidth). Every GLES 3.0 device has textures at least this wide and high.
  static constexpr uint32_t kWidth = 2048;

  explicit TableTexture(const TexelFormat& format) : format_(format) {}

  // The table becomes `texels`; only rows that differ from before are uploaded. ResourceExhausted beyond the
  // device's largest texture.
  Status update(std::span<const std::byte> texels);
  void bind(GLuint unit) const { bind_texture(unit, texture_); }

 private:
  Status grow(size_t rows);
  void upload(size_t first_row, size_t end_row);

  TexelFormat format_;
  Texture texture_;
  std::vector<std::byte> content_;  // what the device has, whole rows
};

}  // namespace tessera::client::gles
