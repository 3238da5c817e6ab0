// Pictures for codec tests, and how alike two of them are.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/image.h"
#include "base/yuv.h"

namespace tessera::codec {

// Every byte random (alpha too).
Image8 noise_image(uint32_t width, uint32_t height, uint32_t seed);
YuvImage noise_picture(uint32_t width, uint32_t height, uint32_t seed);

// Like an atlas: 16 x 16 blocks, each with its own colour, gradient and waves. `churn` of 100 blocks are
// others in every `frame`; with 0 the picture stands still.
YuvImage atlas_picture(uint32_t width, uint32_t height, uint32_t frame, uint32_t churn);

// Peak signal to noise ratio of luma, dB.
double psnr(const YuvView& a, const YuvView& b);

}  // namespace tessera::codec
