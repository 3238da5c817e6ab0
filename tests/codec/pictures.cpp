#include "pictures.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace tessera::codec {
namespace {

YuvImage blank(uint32_t width, uint32_t height) {
  const size_t luma = size_t{width} * height;
  return {width, height, std::vector<uint8_t>(luma), std::vector<uint8_t>(luma / 4),
          std::vector<uint8_t>(luma / 4)};
}

void draw_block(YuvImage& picture, uint32_t x0, uint32_t y0, uint32_t seed) {
  std::mt19937 random(seed);
  const auto between = [&](double low, double high) { return low + (high - low) * (random() % 1024) / 1023; };
  const double base = between(40, 200), dx = between(-3, 3), dy = between(-3, 3);
  const double waves = between(0, 15), frequency = between(0.1, 1.5);
  const auto u = static_cast<uint8_t>(between(100, 156)), v = static_cast<uint8_t>(between(100, 156));
  for (uint32_t y = y0; y < std::min(y0 + 16, picture.height); ++y)
    for (uint32_t x = x0; x < std::min(x0 + 16, picture.width); ++x) {
      const double value = base + dx * (x - x0) + dy * (y - y0) +
                           waves * std::sin(frequency * (x - x0) + 0.7 * frequency * (y - y0)) +
                           between(-2, 2);
      picture.y[size_t{y} * picture.width + x] = static_cast<uint8_t>(std::clamp(value, 16.0, 235.0));
      const size_t chroma = size_t{y / 2} * (picture.width / 2) + x / 2;
      picture.u[chroma] = u;
      picture.v[chroma] = v;
    }
}

}  // namespace

Image8 noise_image(uint32_t width, uint32_t height, uint32_t seed) {
  std::mt19937 random(seed);
  Image8 image(width, height);
  for (uint8_t& b : image.rgba) b = static_cast<uint8_t>(random());
  return image;
}

YuvImage noise_picture(uint32_t width, uint32_t height, uint32_t seed) {
  std::mt19937 random(seed);
  YuvImage picture = blank(width, height);
  for (auto* plane : {&picture.y, &picture.u, &picture.v})
    for (uint8_t& b : *plane) b = static_cast<uint8_t>(16 + random() % 220);
  return picture;
}

YuvImage atlas_picture(uint32_t width, uint32_t height, uint32_t frame, uint32_t churn) {
  YuvImage picture = blank(width, height);
  for (uint32_t y = 0; y < height; y += 16)
    for (uint32_t x = 0; x < width; x += 16) {
      const uint32_t block = y * 1024 + x + 1;
      const bool changes = std::mt19937(block * 31 + frame)() % 100 < churn;
      draw_block(picture, x, y, changes ? block + 7919 * (frame + 1) : block);
    }
  return picture;
}

double psnr(const YuvView& a, const YuvView& b) {
  double sum = 0;
  for (uint32_t y = 0; y < a.height; ++y)
    for (uint32_t x = 0; x < a.width; ++x) {
      const double d = double{0} + a.y[size_t{y} * a.y_stride + x] - b.y[size_t{y} * b.y_stride + x];
      sum += d * d;
    }
  return 10 * std::log10(255 * 255 * double(a.width) * a.height / std::max(sum, 1e-9));
}

}  // namespace tessera::codec
