// A multisampled picture with depth, and its way back to the CPU.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/image.h"
#include "client-sdk/gles/gl.h"

namespace tessera::client::gles {

class OffscreenTarget {
 public:
  // InvalidArgument if the device does not support the size or the number of samples (1 = no multisampling).
  static StatusOr<OffscreenTarget> create(uint32_t width, uint32_t height, uint32_t samples);

  static uint32_t max_samples();  // a pixel

  // Several samples a pixel, depth; contents are undefined until cleared.
  GLuint framebuffer() const { return framebuffer_.id(); }
  uint32_t width() const { return width_; }
  uint32_t height() const { return height_; }

  // Averages the encoded values of each pixel's samples into picture(). Needs the scissor test off.
  void resolve();
  const Texture& picture() const { return picture_; }
  // Resolves; row 0 = top.
  StatusOr<Image8> read_back();

 private:
  OffscreenTarget() = default;

  uint32_t width_ = 0, height_ = 0;
  Renderbuffer color_, depth_;
  Texture picture_;
  Framebuffer framebuffer_, resolved_;
  std::vector<uint8_t> bottom_up_;
};

}  // namespace tessera::client::gles
