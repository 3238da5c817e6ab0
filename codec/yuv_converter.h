// Atlas image (sRGB RGBA8 on the device) → I420 in mapped memory, BT.709 limited range: 1.5 bytes a texel
// read back.
#pragma once

#include <memory>

#include "base/yuv.h"
#include "gpu/commands.h"
#include "gpu/image.h"

namespace tessera::codec {

class YuvConverter {
 public:
  // Width and height even (InvalidArgument otherwise); width a multiple of 8.
  static StatusOr<std::unique_ptr<YuvConverter>> create(gpu::Device& device, uint32_t width, uint32_t height);
  ~YuvConverter();

  // `image` has the size given to create() and stays the same object between calls where possible (rebinding
  // is cheap, but not free).
  Status record(gpu::Commands& commands, const gpu::Image& image);
  // After that work is done, until the next record().
  YuvView result() const;

 private:
  struct Impl;
  explicit YuvConverter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::codec
