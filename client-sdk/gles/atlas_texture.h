// The atlas as the drawing pass samples it: RGBA8, sRGB-encoded values filtered as they are, row 0 on top.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "base/image.h"
#include "base/yuv.h"
#include "client-sdk/gles/gl.h"

namespace tessera::client::gles {

class AtlasTexture {
 public:
  static StatusOr<AtlasTexture> create();

  // BT.709 limited range to RGB by a full-screen pass; each chroma sample serves its 2x2 texels and no
  // others.
  Status set(const YuvView& atlas);
  Status set(const Image8& atlas);

  void bind(GLuint unit) const { bind_texture(unit, rgba_); }
  uint32_t width() const { return width_; }  // 0 before the first set()
  uint32_t height() const { return height_; }

 private:
  AtlasTexture() = default;
  Status resize(uint32_t width, uint32_t height);
  Status resize_planes();

  uint32_t width_ = 0, height_ = 0;
  uint32_t plane_width_ = 0, plane_height_ = 0;  // 0 until the atlas first comes as YUV
  Texture rgba_;
  std::array<Texture, 3> planes_;
  Framebuffer framebuffer_;
  VertexArray no_attributes_;
  Program convert_;
};

}  // namespace tessera::client::gles
