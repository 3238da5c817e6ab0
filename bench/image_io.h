// PNG files, and maps of numbers as pictures.
#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include "base/image.h"
#include "base/status.h"
#include "bench/ssim.h"

namespace tessera::bench {

// RGB, 8 bit; alpha is left out.
std::vector<uint8_t> encode_png(const Image8& image);
// The same as JPEG of high quality without chroma subsampling, for pages.
std::vector<uint8_t> encode_jpeg(const Image8& image);
// Any PNG of at most 16384 pixels a side; alpha 255 where it has none. `name` stands for its source in
// messages.
StatusOr<Image8> decode_png(std::span<const uint8_t> bytes, const std::string& name);

Status write_png(const std::filesystem::path& file, const Image8& image);
StatusOr<Image8> read_png(const std::filesystem::path& file);

// The DSSIM of each pixel, (1 - ssim) / 2, in false colour: black = none, over violet and orange to pale
// yellow = `full_scale` and above.
constexpr float kDssimFullScale = 0.25f;
Image8 dssim_picture(const Plane& ssim, float full_scale = kDssimFullScale);
// The colours of dssim_picture() from none to full scale, left to right: its legend.
Image8 dssim_legend(uint32_t width, uint32_t height);

}  // namespace tessera::bench
