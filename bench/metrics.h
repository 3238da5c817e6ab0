// Image errors as every report states them (thesis 7.2.2 for mssim). All on sRGB-encoded values / 255; alpha
// is ignored. Pictures that are compared have the same, non-zero size.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "absl/functional/function_ref.h"
#include "base/image.h"
#include "bench/ssim.h"

namespace tessera::bench {

// PSNR of identical pictures is infinite; it counts as this many dB, so that means stay finite.
constexpr double kMaxPsnrDb = 100;

struct ImageError {
  double mssim = 1;              // luma, Gaussian window of 11 px, sigma 2; window clipped at the borders
  double psnr = kMaxPsnrDb;      // dB, luma
  double psnr_rgb = kMaxPsnrDb;  // dB, over all three channels
  double ssim7 = 1;  // 7x7 uniform window, unbiased, mean over RGB and the pixels with a whole window
  double linf = 0;   // largest difference of any channel
  std::array<double, 3> l2{};  // root mean square, per channel
  double delta_e_borders = 0;  // mean CIEDE2000 near primitive borders

  double dssim() const { return (1 - mssim) / 2; }
};

struct Comparison {
  ImageError error;
  Plane ssim;  // per pixel, the map whose mean is `mssim`
};

// `triangle_ids`: the truth's id image (one value a pixel), or empty: then delta_e_borders is 0.
Comparison compare_images(const Image8& truth, const Image8& shown,
                          std::span<const uint32_t> triangle_ids = {});

// Only mssim and psnr, in a fraction of the time.
ImageError compare_luma(const Image8& truth, const Image8& shown);

double psnr_db(double mean_squared_error);

// Mean CIEDE2000 over the pixels within 2 px of a border between different ids; 0 if there is none.
double delta_e_near_borders(const Image8& truth, const Image8& shown, std::span<const uint32_t> triangle_ids);

// Share of all pixels whose truth samples all hit geometry (`covered` 1) and whose centre triangle is not in
// the client's visible set. `triangle_plus_one` as in shading::ReferenceImage; `is_visible` takes the
// triangle id.
double hole_share(std::span<const uint32_t> triangle_plus_one, std::span<const uint8_t> covered,
                  absl::FunctionRef<bool(uint32_t)> is_visible);

// Arithmetic means of errors over frames (linf: the largest).
class ErrorMean {
 public:
  void add(const ImageError& error);
  ImageError mean() const;  // of nothing: a perfect picture
  uint64_t count() const { return count_; }

 private:
  ImageError sum_{0, 0, 0, 0, 0, {}, 0};
  uint64_t count_ = 0;
};

}  // namespace tessera::bench
