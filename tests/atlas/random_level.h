#pragma once

#include <algorithm>
#include <random>

#include "atlas/level_selection.h"

namespace tessera::atlas {

// Small blocks are many.
inline Level random_level(std::mt19937& random, uint8_t max_log) {
  const auto draw = [&] {
    std::uniform_real_distribution<float> uniform(0, 1);
    const float v = uniform(random);
    return static_cast<uint8_t>(kMinLog +
                                static_cast<int>(v * v * static_cast<float>(max_log - kMinLog) + 0.5f));
  };
  const uint8_t a = draw(), b = draw();
  return {std::max(a, b), std::min(a, b)};
}

}  // namespace tessera::atlas
