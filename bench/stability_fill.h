// The catalogue's cases of an atlas that is exactly full, or almost: layouts alone, without a device.
#pragma once

#include <vector>

#include "bench/stability.h"

namespace tessera::bench {

std::vector<StabilityCase> fill_stability_cases();

}  // namespace tessera::bench
