#include "bench/color_difference.h"

#include <cmath>
#include <numbers>

namespace tessera::bench {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

double linear_from_srgb(uint8_t byte) {
  static const std::array<double, 256> table = [] {
    std::array<double, 256> t;
    for (int i = 0; i < 256; ++i) {
      const double v = i / 255.0;
      t[i] = v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
    }
    return t;
  }();
  return table[byte];
}

double lab_curve(double t) {
  constexpr double kDelta = 6.0 / 29.0;
  return t > kDelta * kDelta * kDelta ? std::cbrt(t) : t / (3 * kDelta * kDelta) + 4.0 / 29.0;
}

// Degrees in [0, 360); 0 for a colour without chroma.
double hue(double a, double b) {
  if (a == 0 && b == 0) return 0;
  const double h = std::atan2(b, a) / kDegree;
  return h < 0 ? h + 360 : h;
}

double pow7(double x) {
  return x * x * x * x * x * x * x;
}

// sqrt(C^7 / (C^7 + 25^7)), which both the chroma stretch and the rotation term use.
double high_chroma_share(double c) {
  constexpr double k25Pow7 = 6103515625.0;
  return std::sqrt(pow7(c) / (pow7(c) + k25Pow7));
}

double hue_difference(double c1, double h1, double c2, double h2) {
  if (c1 * c2 == 0) return 0;
  const double d = h2 - h1;
  return d > 180 ? d - 360 : d < -180 ? d + 360 : d;
}

double mean_hue(double c1, double h1, double c2, double h2) {
  if (c1 * c2 == 0) return h1 + h2;
  if (std::abs(h1 - h2) <= 180) return (h1 + h2) / 2;
  return h1 + h2 < 360 ? (h1 + h2 + 360) / 2 : (h1 + h2 - 360) / 2;
}

}  // namespace

glm::dvec3 lab_from_srgb(const uint8_t rgb[3]) {
  const double r = linear_from_srgb(rgb[0]), g = linear_from_srgb(rgb[1]), b = linear_from_srgb(rgb[2]);
  // IEC 61966-2-1 primaries; divided by the D65 white (0.95047, 1, 1.08883).
  const double x = (0.4124564 * r + 0.3575761 * g + 0.1804375 * b) / 0.95047;
  const double y = 0.2126729 * r + 0.7151522 * g + 0.0721750 * b;
  const double z = (0.0193339 * r + 0.1191920 * g + 0.9503041 * b) / 1.08883;
  const double fx = lab_curve(x), fy = lab_curve(y), fz = lab_curve(z);
  return {116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)};
}

double ciede2000(const glm::dvec3& lab1, const glm::dvec3& lab2) {
  const double mean_c_ab = (std::hypot(lab1.y, lab1.z) + std::hypot(lab2.y, lab2.z)) / 2;
  const double stretch = 1 + 0.5 * (1 - high_chroma_share(mean_c_ab));
  const double a1 = stretch * lab1.y, a2 = stretch * lab2.y;
  const double c1 = std::hypot(a1, lab1.z), c2 = std::hypot(a2, lab2.z);
  const double h1 = hue(a1, lab1.z), h2 = hue(a2, lab2.z);

  const double dl = lab2.x - lab1.x, dc = c2 - c1;
  const double dh = 2 * std::sqrt(c1 * c2) * std::sin(hue_difference(c1, h1, c2, h2) / 2 * kDegree);

  const double l = (lab1.x + lab2.x) / 2, c = (c1 + c2) / 2, h = mean_hue(c1, h1, c2, h2);
  const double t = 1 - 0.17 * std::cos((h - 30) * kDegree) + 0.24 * std::cos(2 * h * kDegree) +
                   0.32 * std::cos((3 * h + 6) * kDegree) - 0.20 * std::cos((4 * h - 63) * kDegree);
  const double l50 = (l - 50) * (l - 50);
  const double sl = 1 + 0.015 * l50 / std::sqrt(20 + l50);
  const double sc = 1 + 0.045 * c, sh = 1 + 0.015 * c * t;
  const double rotation = 30 * std::exp(-((h - 275) / 25) * ((h - 275) / 25));
  const double rt = -2 * high_chroma_share(c) * std::sin(2 * rotation * kDegree);
  const double tl = dl / sl, tc = dc / sc, th = dh / sh;
  return std::sqrt(std::max(0.0, tl * tl + tc * tc + th * th + rt * tc * th));
}

}  // namespace tessera::bench
