// Which texels of an atlas hold samples, in the codec's terms.
#pragma once

#include <span>

#include "atlas/placement.h"
#include "codec/occupancy.h"

namespace tessera::server {

// Those of these placements. All others become unused.
void map_samples(std::span<const atlas::Placement> placements, codec::Occupancy& used);

}  // namespace tessera::server
