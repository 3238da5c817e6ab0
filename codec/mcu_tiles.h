// The squares of an atlas that hold samples (16x16 texels, the MCUs of JPEG with 4:2:0 chroma), gathered into
// small pictures and put back. What holds no sample is never looked at.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/yuv.h"
#include "codec/atlas_encoder.h"

namespace tessera::codec {

// Row by row from the upper left: row * columns + column, ascending.
std::vector<uint32_t> used_mcus(const Occupancy& used);

// Gives `tile` the size of a picture of `mcus` squares, up to 16 in a row. Its contents are not set.
void resize_tile(size_t mcus, YuvImage& tile);

// Copies those squares of the picture into the tile, one after another. In each 8x8 block that is partly
// unused, the unused texels continue the used ones smoothly: a step would take bits, and ring into them (TSS,
// section 4, "Encoding"). Blocks without samples, and squares at the tile's end beyond the last, take the
// mean of the block before, which costs next to nothing.
void gather(const AtlasPicture& picture, std::span<const uint32_t> mcus, YuvImage& tile);

// The inverse: those squares of the picture become the tile's; the others stay.
void scatter(const YuvImage& tile, std::span<const uint32_t> mcus, YuvImage& picture);

}  // namespace tessera::codec
