#include "bench/ssim.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <numeric>

namespace tessera::bench {
namespace {

constexpr float kC1 = 1e-4f, kC2 = 9e-4f;  // (0.01 L)^2, (0.03 L)^2 with L = 1

// The moments that SSIM needs: E[a], E[b], E[a^2 + b^2], E[ab].
constexpr int kMoments = 4;
using Moments = std::array<Plane, kMoments>;

Moments products(const Plane& a, const Plane& b) {
  Moments m{a, b, Plane(a.width, a.height), Plane(a.width, a.height)};
  const size_t n = a.values.size();
  const float *pa = a.values.data(), *pb = b.values.data();
  float *squares = m[2].values.data(), *mixed = m[3].values.data();
  for (size_t i = 0; i < n; ++i) {
    squares[i] = pa[i] * pa[i] + pb[i] * pb[i];
    mixed[i] = pa[i] * pb[i];
  }
  return m;
}

// 1 / (sum of the weights that fall inside), for each of `size` positions. The clipped window is a rectangle,
// so its normalisation is the product of both axes' values.
std::vector<float> renormalisation(const std::vector<float>& weights, uint32_t size) {
  const int radius = static_cast<int>(weights.size() / 2);
  std::vector<float> result(size);
  for (int i = 0; i < static_cast<int>(size); ++i) {
    float sum = 0;
    for (int k = -radius; k <= radius; ++k) {
      if (i + k >= 0 && i + k < static_cast<int>(size)) sum += weights[k + radius];
    }
    result[i] = 1 / sum;
  }
  return result;
}

void add_scaled(float* __restrict to, const float* __restrict from, float weight, uint32_t n) {
  for (uint32_t i = 0; i < n; ++i) to[i] += weight * from[i];
}

// Filters one row of one plane: down the columns into `padded` (zeros on both sides), then along the row into
// `out`.
void filter_row(const Plane& in, uint32_t y, const std::vector<float>& weights, float* padded, float* out) {
  const int radius = static_cast<int>(weights.size() / 2);
  float* column_sums = padded + radius;
  std::fill_n(column_sums, in.width, 0.0f);
  const int first = std::max(-radius, -static_cast<int>(y));
  const int last = std::min(radius, static_cast<int>(in.height - 1 - y));
  for (int k = first; k <= last; ++k) add_scaled(column_sums, in.row(y + k), weights[k + radius], in.width);
  std::fill_n(out, in.width, 0.0f);
  for (size_t k = 0; k < weights.size(); ++k) add_scaled(out, padded + k, weights[k], in.width);
}

void ssim_row(const std::array<std::vector<float>, kMoments>& filtered, const float* scale_x, float scale_y,
              float covariance_scale, uint32_t n, float* __restrict out) {
  const float *fa = filtered[0].data(), *fb = filtered[1].data(), *fs = filtered[2].data(),
              *fm = filtered[3].data();
  for (uint32_t x = 0; x < n; ++x) {
    const float s = scale_x[x] * scale_y;
    const float ma = fa[x] * s, mb = fb[x] * s;
    const float variances = covariance_scale * (fs[x] * s - ma * ma - mb * mb);
    const float covariance = covariance_scale * (fm[x] * s - ma * mb);
    out[x] = (2 * ma * mb + kC1) * (2 * covariance + kC2) / ((ma * ma + mb * mb + kC1) * (variances + kC2));
  }
}

}  // namespace

Plane luma(const Image8& image) {
  Plane plane(image.width, image.height);
  const uint8_t* p = image.rgba.data();
  for (float& value : plane.values) {
    value = (0.2126f * p[0] + 0.7152f * p[1] + 0.0722f * p[2]) * (1 / 255.0f);
    p += 4;
  }
  return plane;
}

Plane channel(const Image8& image, uint32_t index) {
  Plane plane(image.width, image.height);
  const uint8_t* p = image.rgba.data() + index;
  for (float& value : plane.values) {
    value = *p * (1 / 255.0f);
    p += 4;
  }
  return plane;
}

SsimWindow gaussian_window(uint32_t size, double sigma) {
  std::vector<double> g(size);
  for (uint32_t i = 0; i < size; ++i) {
    const double d = i - 0.5 * (size - 1);
    g[i] = std::exp(-d * d / (2 * sigma * sigma));
  }
  const double sum = std::accumulate(g.begin(), g.end(), 0.0);
  SsimWindow window;
  for (const double w : g) window.weights.push_back(static_cast<float>(w / sum));
  return window;
}

SsimWindow uniform_window(uint32_t size) {
  const auto n = static_cast<float>(size * size);
  return {std::vector<float>(size, 1 / static_cast<float>(size)), n / (n - 1)};
}

Plane ssim_map(const Plane& a, const Plane& b, const SsimWindow& window) {
  assert(a.width == b.width && a.height == b.height && !a.values.empty() && window.weights.size() % 2 == 1);
  const Moments moments = products(a, b);
  const std::vector<float> scale_x = renormalisation(window.weights, a.width);
  const std::vector<float> scale_y = renormalisation(window.weights, a.height);
  std::vector<float> padded(a.width + window.weights.size() - 1);
  std::array<std::vector<float>, kMoments> filtered;
  for (auto& row : filtered) row.resize(a.width);

  Plane map(a.width, a.height);
  for (uint32_t y = 0; y < a.height; ++y) {
    for (int i = 0; i < kMoments; ++i) {
      filter_row(moments[i], y, window.weights, padded.data(), filtered[i].data());
    }
    ssim_row(filtered, scale_x.data(), scale_y[y], window.covariance_scale, a.width, map.row(y));
  }
  return map;
}

double mean(const Plane& plane, uint32_t inset) {
  if (2 * inset >= std::min(plane.width, plane.height)) inset = 0;
  double sum = 0;
  for (uint32_t y = inset; y < plane.height - inset; ++y) {
    const float* row = plane.row(y);
    sum += std::accumulate(row + inset, row + plane.width - inset, 0.0);
  }
  return sum / (double{1} * (plane.width - 2 * inset) * (plane.height - 2 * inset));
}

}  // namespace tessera::bench
