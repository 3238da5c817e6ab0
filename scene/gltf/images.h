// Decoding of PNG and JPEG files.
#pragma once

#include "scene/gltf/document.h"

namespace tessera::scene {

struct ImageSize {
  uint32_t width = 0, height = 0;
  uint64_t rgba_bytes() const { return uint64_t{4} * width * height; }
};

// From the file's header: nothing is decoded, and sides over the limit are an error.
StatusOr<ImageSize> read_image_size(const Document& document, int image);

// RGBA8, for images whose size has been checked; on all cores. Result i belongs to images[i].
StatusOr<std::vector<std::vector<uint8_t>>> decode_images(const Document& document,
                                                          std::span<const int> images);

}  // namespace tessera::scene
