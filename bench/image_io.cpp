#include "bench/image_io.h"

#include <stb_image.h>
#include <stb_image_write.h>

#include <algorithm>
#include <array>
#include <memory>

#include "base/math.h"
#include "bench/file_io.h"

namespace tessera::bench {
namespace {

constexpr int kMaxSide = 16384;
constexpr int kJpegQuality = 94;  // above 90 stb keeps chroma at full resolution

// sRGB; brightness grows steadily, so the map also reads in grey.
vec3 false_color(float t) {
  static constexpr std::array<std::array<float, 3>, 6> kStops{
      {{0, 0, 4}, {66, 12, 104}, {147, 38, 103}, {221, 81, 58}, {252, 165, 10}, {252, 255, 164}}};
  const float x = std::clamp(t, 0.0f, 1.0f) * (kStops.size() - 1);
  const auto i = std::min(static_cast<size_t>(x), kStops.size() - 2);
  const auto &a = kStops[i], &b = kStops[i + 1];
  return glm::mix(vec3(a[0], a[1], a[2]), vec3(b[0], b[1], b[2]), x - static_cast<float>(i));
}

void set_pixel(uint8_t* p, vec3 color) {
  for (int c = 0; c < 3; ++c) p[c] = static_cast<uint8_t>(color[c] + 0.5f);
  p[3] = 255;
}

std::vector<uint8_t> without_alpha(const Image8& image) {
  std::vector<uint8_t> rgb;
  rgb.reserve(size_t{3} * image.width * image.height);
  for (size_t i = 0; i < image.rgba.size(); i += 4) {
    rgb.insert(rgb.end(), &image.rgba[i], &image.rgba[i] + 3);
  }
  return rgb;
}

void append(void* context, void* data, int size) {
  auto& out = *static_cast<std::vector<uint8_t>*>(context);
  const auto* bytes = static_cast<const uint8_t*>(data);
  out.insert(out.end(), bytes, bytes + size);
}

}  // namespace

std::vector<uint8_t> encode_png(const Image8& image) {
  const std::vector<uint8_t> rgb = without_alpha(image);
  std::vector<uint8_t> png;
  const auto w = static_cast<int>(image.width), h = static_cast<int>(image.height);
  stbi_write_png_to_func(append, &png, w, h, 3, rgb.data(), 3 * w);
  return png;
}

std::vector<uint8_t> encode_jpeg(const Image8& image) {
  const std::vector<uint8_t> rgb = without_alpha(image);
  std::vector<uint8_t> jpeg;
  stbi_write_jpg_to_func(append, &jpeg, static_cast<int>(image.width), static_cast<int>(image.height), 3,
                         rgb.data(), kJpegQuality);
  return jpeg;
}

StatusOr<Image8> decode_png(std::span<const uint8_t> bytes, const std::string& name) {
  const int size = static_cast<int>(std::min<size_t>(bytes.size(), INT32_MAX));
  int w = 0, h = 0, channels = 0;
  if (!stbi_info_from_memory(bytes.data(), size, &w, &h, &channels)) {
    return absl::InvalidArgumentError(absl::StrCat(name, ": not a readable image"));
  }
  if (w > kMaxSide || h > kMaxSide) {
    return absl::InvalidArgumentError(
        absl::StrCat(name, ": ", w, "x", h, " is larger than ", kMaxSide, " a side"));
  }
  const std::unique_ptr<stbi_uc, void (*)(void*)> pixels(
      stbi_load_from_memory(bytes.data(), size, &w, &h, &channels, 4), stbi_image_free);
  if (!pixels) return absl::InvalidArgumentError(absl::StrCat(name, ": the image data is damaged"));
  Image8 image(w, h);
  std::copy_n(pixels.get(), image.rgba.size(), image.rgba.begin());
  return image;
}

Status write_png(const std::filesystem::path& file, const Image8& image) {
  return write_file(file, std::span<const uint8_t>(encode_png(image)));
}

StatusOr<Image8> read_png(const std::filesystem::path& file) {
  TESSERA_ASSIGN_OR_RETURN(const std::vector<uint8_t> bytes, read_file(file));
  return decode_png(bytes, file.string());
}

Image8 dssim_picture(const Plane& ssim, float full_scale) {
  Image8 image(ssim.width, ssim.height);
  for (size_t i = 0; i < ssim.values.size(); ++i) {
    set_pixel(&image.rgba[4 * i], false_color((1 - ssim.values[i]) / 2 / full_scale));
  }
  return image;
}

Image8 dssim_legend(uint32_t width, uint32_t height) {
  Image8 image(width, height);
  for (uint32_t y = 0; y < height; ++y) {
    for (uint32_t x = 0; x < width; ++x) {
      set_pixel(image.at(x, y),
                false_color(static_cast<float>(x) / static_cast<float>(std::max(1u, width - 1))));
    }
  }
  return image;
}

}  // namespace tessera::bench
