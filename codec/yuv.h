// The same colour conversion on the CPU: BT.709, limited range, chroma = mean of 2x2, and back with chroma
// replicated (nearest), as the client's shader does it. The reference for the device versions and for tests.
#pragma once

#include <cstddef>

#include "base/image.h"
#include "base/yuv.h"

namespace tessera::codec {

YuvImage rgb_to_yuv(const Image8& image);  // even sides
Image8 yuv_to_rgb(const YuvView& yuv);     // alpha 255
YuvView view_of(const YuvImage& image);
// Even sides; new values are unspecified.
void resize(uint32_t width, uint32_t height, YuvImage& image);

}  // namespace tessera::codec
