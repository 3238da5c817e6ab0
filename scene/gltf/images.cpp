#include "scene/gltf/images.h"

#include <stb_image.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <thread>

namespace tessera::scene {
namespace {

std::string image_path(int image) {
  return absl::StrCat("/images/", image);
}

// glTF allows these two only; stb_image's other decoders stay out of reach of hostile files.
bool is_png_or_jpeg(std::span<const uint8_t> file) {
  constexpr uint8_t kPng[] = {0x89, 'P', 'N', 'G'}, kJpeg[] = {0xFF, 0xD8, 0xFF};
  const auto starts_with = [&](std::span<const uint8_t> magic) {
    return file.size() >= magic.size() && std::equal(magic.begin(), magic.end(), file.begin());
  };
  return starts_with(kPng) || starts_with(kJpeg);
}

StatusOr<std::vector<uint8_t>> decode(const Document& document, int image) {
  TESSERA_ASSIGN_OR_RETURN(const std::vector<uint8_t> file, document.image_file(image));
  int width = 0, height = 0, channels = 0;
  const std::unique_ptr<stbi_uc, void (*)(void*)> pixels(
      stbi_load_from_memory(file.data(), static_cast<int>(file.size()), &width, &height, &channels, 4),
      stbi_image_free);
  if (!pixels)
    return document.error(image_path(image), absl::StrCat("cannot be decoded: ", stbi_failure_reason()));
  return std::vector<uint8_t>(
      pixels.get(), pixels.get() + size_t{4} * static_cast<size_t>(width) * static_cast<size_t>(height));
}

}  // namespace

StatusOr<ImageSize> read_image_size(const Document& document, int image) {
  TESSERA_ASSIGN_OR_RETURN(const std::vector<uint8_t> file, document.image_file(image));
  int width = 0, height = 0, channels = 0;
  if (!is_png_or_jpeg(file)) return document.error(image_path(image), "is neither PNG nor JPEG");
  if (file.size() > size_t{1} << 30)
    return document.over_limit(image_path(image), "the file is larger than 1 GiB");
  if (!stbi_info_from_memory(file.data(), static_cast<int>(file.size()), &width, &height, &channels) ||
      width < 1 || height < 1) {
    return document.error(image_path(image), absl::StrCat("has no valid header: ", stbi_failure_reason()));
  }
  const ImageSize size{static_cast<uint32_t>(width), static_cast<uint32_t>(height)};
  const uint32_t limit = document.limits().max_texture_side;
  if (size.width > limit || size.height > limit) {
    return document.over_limit(image_path(image),
                               absl::StrFormat("%dx%d pixels; the limit is %d a side", width, height, limit));
  }
  return size;
}

StatusOr<std::vector<std::vector<uint8_t>>> decode_images(const Document& document,
                                                          std::span<const int> images) {
  std::vector<std::vector<uint8_t>> pixels(images.size());
  std::vector<Status> failures(images.size());
  std::atomic<size_t> next = 0;
  const auto work = [&] {
    for (size_t i = next++; i < images.size(); i = next++) {
      StatusOr<std::vector<uint8_t>> decoded = decode(document, images[i]);
      if (decoded.ok()) {
        pixels[i] = *std::move(decoded);
      } else {
        failures[i] = decoded.status();
      }
    }
  };
  {
    std::vector<std::jthread> helpers(
        std::min<size_t>(images.size() / 2, std::thread::hardware_concurrency() - 1));
    for (std::jthread& helper : helpers) helper = std::jthread(work);
    work();
  }
  for (const Status& failure : failures) TESSERA_RETURN_IF_ERROR(failure);
  return pixels;
}

}  // namespace tessera::scene
