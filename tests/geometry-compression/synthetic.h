// MetaFrames for tests: random ones that use the whole range of every field, and one like those of a real
// mesh.
#pragma once

#include <cstdint>
#include <random>

#include "geometry-compression/meta_frame.h"

namespace tessera::geometry_compression {

// Up to `max_items` items a section, every field over its whole range, duplicates and repetitions included.
MetaFrame random_frame(std::mt19937& random, uint32_t max_items);

// A bumpy torus of `side` x `side` pairs of triangles (every tenth one a lone triangle), quantised to 2^14
// steps, in clusters of 8 x 8 that come in random order; vertices are numbered as the patches need them. All
// patches are placed as blocks of 4..32 texels in columns of equal width, but one in eight, which is a
// colour.
MetaFrame torus_frame(std::mt19937& random, uint32_t side);

}  // namespace tessera::geometry_compression
