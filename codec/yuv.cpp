#include "codec/yuv.h"

#include <algorithm>
#include <cassert>

namespace tessera::codec {
namespace {

// BT.709 (Kr = 0.2126, Kb = 0.0722), limited range, times 2^16; codec/shaders/rgb_to_yuv.comp has the same
// integers. Luma: 219 / 255 * (Kr, Kg, Kb). Chroma: 224 / 255 / 2 * (…) / (1 - K); each row sums to 0, so
// that greys are 128.
constexpr int32_t kShift = 16;
constexpr int32_t kLuma[3] = {11966, 40254, 4064};
constexpr int32_t kBlue[3] = {-6596, -22189, 28785};
constexpr int32_t kRed[3] = {28785, -26145, -2640};

uint8_t luma(const uint8_t* rgb) {
  const int32_t sum = kLuma[0] * rgb[0] + kLuma[1] * rgb[1] + kLuma[2] * rgb[2];
  return static_cast<uint8_t>(16 + ((sum + (1 << (kShift - 1))) >> kShift));
}

// `sum4`: the channels' sums over four texels.
uint8_t chroma(const int32_t (&weights)[3], const int32_t (&sum4)[3]) {
  const int32_t sum = weights[0] * sum4[0] + weights[1] * sum4[1] + weights[2] * sum4[2];
  return static_cast<uint8_t>(128 + ((sum + (1 << (kShift + 1))) >> (kShift + 2)));
}

uint8_t to_byte(int32_t fixed) {
  return static_cast<uint8_t>(std::clamp((fixed + (1 << (kShift - 1))) >> kShift, 0, 255));
}

}  // namespace

YuvImage rgb_to_yuv(const Image8& image) {
  assert(image.width % 2 == 0 && image.height % 2 == 0);
  YuvImage out{image.width, image.height, {}, {}, {}};
  out.y.reserve(size_t{image.width} * image.height);
  out.u.reserve(out.y.capacity() / 4);
  out.v.reserve(out.y.capacity() / 4);
  for (uint32_t y = 0; y < image.height; ++y)
    for (uint32_t x = 0; x < image.width; ++x) out.y.push_back(luma(image.at(x, y)));
  for (uint32_t y = 0; y < image.height; y += 2)
    for (uint32_t x = 0; x < image.width; x += 2) {
      int32_t sum[3] = {};
      for (const uint8_t* texel :
           {image.at(x, y), image.at(x + 1, y), image.at(x, y + 1), image.at(x + 1, y + 1)})
        for (int c = 0; c < 3; ++c) sum[c] += texel[c];
      out.u.push_back(chroma(kBlue, sum));
      out.v.push_back(chroma(kRed, sum));
    }
  return out;
}

Image8 yuv_to_rgb(const YuvView& yuv) {
  // The inverse, times 2^16: 255 / 219; 255 / 224 * 2 (1 - Kr); its green parts; 255 / 224 * 2 (1 - Kb).
  constexpr int32_t kY = 76309, kRv = 117489, kGu = -13975, kGv = -34925, kBu = 138438;
  Image8 out(yuv.width, yuv.height);
  for (uint32_t y = 0; y < yuv.height; ++y)
    for (uint32_t x = 0; x < yuv.width; ++x) {
      const size_t at = size_t{y / 2} * yuv.uv_stride + x / 2;
      const int32_t luma = kY * (yuv.y[size_t{y} * yuv.y_stride + x] - 16);
      const int32_t u = yuv.u[at] - 128, v = yuv.v[at] - 128;
      uint8_t* rgba = out.at(x, y);
      rgba[0] = to_byte(luma + kRv * v);
      rgba[1] = to_byte(luma + kGu * u + kGv * v);
      rgba[2] = to_byte(luma + kBu * u);
      rgba[3] = 255;
    }
  return out;
}

YuvView view_of(const YuvImage& image) {
  return {image.width,    image.height, image.y.data(), image.u.data(),
          image.v.data(), image.width,  image.width / 2};
}

void resize(uint32_t width, uint32_t height, YuvImage& image) {
  image.width = width;
  image.height = height;
  image.y.resize(size_t{width} * height);
  image.u.resize(image.y.size() / 4);
  image.v.resize(image.y.size() / 4);
}

}  // namespace tessera::codec
