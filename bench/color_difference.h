// CIEDE2000: the colour difference that people see (CIE 142-2001; Sharma, Wu, Dalal 2005).
#pragma once

#include <array>
#include <cstdint>

#include "base/math.h"

namespace tessera::bench {

// CIE L*a*b* under D65, from sRGB-encoded bytes.
glm::dvec3 lab_from_srgb(const uint8_t rgb[3]);

// ΔE00 of two L*a*b* colours, k_L = k_C = k_H = 1. Symmetric, 0 for equal colours, about 1 at the threshold
// of sight.
double ciede2000(const glm::dvec3& lab1, const glm::dvec3& lab2);

}  // namespace tessera::bench
