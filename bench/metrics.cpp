#include "bench/metrics.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdlib>
#include <cstring>

#include "bench/borders.h"
#include "bench/color_difference.h"

namespace tessera::bench {
namespace {

double mean_squared_difference(const Plane& a, const Plane& b) {
  double sum = 0;
  for (size_t i = 0; i < a.values.size(); ++i) {
    const double d = a.values[i] - b.values[i];
    sum += d * d;
  }
  return sum / static_cast<double>(a.values.size());
}

// Fills in linf, l2 and psnr_rgb.
void measure_channels(const Image8& truth, const Image8& shown, ImageError& error) {
  std::array<uint64_t, 3> squares{};
  int largest = 0;
  for (size_t i = 0; i < truth.rgba.size(); i += 4) {
    for (size_t c = 0; c < 3; ++c) {
      const int d = std::abs(truth.rgba[i + c] - shown.rgba[i + c]);
      squares[c] += static_cast<uint64_t>(d * d);
      largest = std::max(largest, d);
    }
  }
  const double pixels = static_cast<double>(truth.rgba.size() / 4);
  double mean_square = 0;
  for (size_t c = 0; c < 3; ++c) {
    const double m = static_cast<double>(squares[c]) / (pixels * 255 * 255);
    error.l2[c] = std::sqrt(m);
    mean_square += m / 3;
  }
  error.linf = largest / 255.0;
  error.psnr_rgb = psnr_db(mean_square);
}

double mean_ssim7(const Image8& truth, const Image8& shown) {
  const SsimWindow window = uniform_window(7);
  double sum = 0;
  for (uint32_t c = 0; c < 3; ++c) sum += mean(ssim_map(channel(truth, c), channel(shown, c), window), 3);
  return sum / 3;
}

// Fills in mssim and psnr, and leaves the map.
Plane measure_luma(const Image8& truth, const Image8& shown, ImageError& error) {
  const Plane luma_truth = luma(truth), luma_shown = luma(shown);
  Plane map = ssim_map(luma_truth, luma_shown, gaussian_window(11, 2));
  error.mssim = mean(map);
  error.psnr = psnr_db(mean_squared_difference(luma_truth, luma_shown));
  return map;
}

}  // namespace

double psnr_db(double mean_squared_error) {
  if (mean_squared_error <= 0) return kMaxPsnrDb;
  return std::min(kMaxPsnrDb, -10 * std::log10(mean_squared_error));
}

double delta_e_near_borders(const Image8& truth, const Image8& shown,
                            std::span<const uint32_t> triangle_ids) {
  assert(triangle_ids.size() == size_t{truth.width} * truth.height);
  const std::vector<uint8_t> border = border_pixels(triangle_ids, truth.width, truth.height);
  double sum = 0;
  uint64_t count = 0;
  for (uint32_t y = 0; y < truth.height; ++y) {
    for (uint32_t x = 0; x < truth.width; ++x) {
      if (!any_in_3x3(border, truth.width, truth.height, x, y)) continue;
      ++count;
      const uint8_t *a = truth.at(x, y), *b = shown.at(x, y);
      if (std::memcmp(a, b, 3) != 0) sum += ciede2000(lab_from_srgb(a), lab_from_srgb(b));
    }
  }
  return count ? sum / static_cast<double>(count) : 0;
}

Comparison compare_images(const Image8& truth, const Image8& shown, std::span<const uint32_t> triangle_ids) {
  assert(truth.width == shown.width && truth.height == shown.height);
  Comparison result;
  ImageError& error = result.error;
  result.ssim = measure_luma(truth, shown, error);
  error.ssim7 = mean_ssim7(truth, shown);
  measure_channels(truth, shown, error);
  if (!triangle_ids.empty()) error.delta_e_borders = delta_e_near_borders(truth, shown, triangle_ids);
  return result;
}

ImageError compare_luma(const Image8& truth, const Image8& shown) {
  assert(truth.width == shown.width && truth.height == shown.height);
  ImageError error;
  measure_luma(truth, shown, error);
  return error;
}

double hole_share(std::span<const uint32_t> triangle_plus_one, std::span<const uint8_t> covered,
                  absl::FunctionRef<bool(uint32_t)> is_visible) {
  assert(triangle_plus_one.size() == covered.size());
  uint64_t holes = 0;
  for (size_t i = 0; i < covered.size(); ++i) {
    if (covered[i] && triangle_plus_one[i] && !is_visible(triangle_plus_one[i] - 1)) ++holes;
  }
  return covered.empty() ? 0 : static_cast<double>(holes) / static_cast<double>(covered.size());
}

void ErrorMean::add(const ImageError& error) {
  ++count_;
  sum_.mssim += error.mssim;
  sum_.psnr += error.psnr;
  sum_.psnr_rgb += error.psnr_rgb;
  sum_.ssim7 += error.ssim7;
  sum_.linf = std::max(sum_.linf, error.linf);
  for (size_t c = 0; c < 3; ++c) sum_.l2[c] += error.l2[c];
  sum_.delta_e_borders += error.delta_e_borders;
}

ImageError ErrorMean::mean() const {
  if (count_ == 0) return {};
  const auto n = static_cast<double>(count_);
  ImageError m = sum_;
  m.mssim /= n;
  m.psnr /= n;
  m.psnr_rgb /= n;
  m.ssim7 /= n;
  for (double& channel : m.l2) channel /= n;
  m.delta_e_borders /= n;
  return m;
}

}  // namespace tessera::bench
