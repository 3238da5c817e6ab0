#include "codec/scale_search.h"

#include <algorithm>
#include <cmath>

#include "codec/jpeg_tile.h"

namespace tessera::codec {

double ScaleSearch::scale_for(double bits_per_mcu) const {
  const double scale = scale_ * std::pow(bits_per_mcu_ / bits_per_mcu, 1 / exponent_);
  return std::clamp(scale, kFinestScale, kCoarsestScale);
}

double ScaleSearch::bits_per_mcu(double scale) const {
  return bits_per_mcu_ * std::pow(scale_ / scale, exponent_);
}

void ScaleSearch::learn(double scale, double bits_per_mcu, bool same_picture) {
  // Points too close to each other, or of different pictures, say nothing about the slope.
  const double run = std::log(scale / scale_), rise = std::log(bits_per_mcu_ / bits_per_mcu);
  if (same_picture && std::abs(run) > 0.05) exponent_ = std::clamp(rise / run, 0.4, 1.5);
  scale_ = scale;
  bits_per_mcu_ = bits_per_mcu;
}

}  // namespace tessera::codec
