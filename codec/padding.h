// Blocks of 8x8 values that hold other things than samples, made harmless for the transform.
#pragma once

#include <cstddef>
#include <cstdint>

namespace tessera::codec {

// Value (x, y) at block[y * stride + x] is used if bit 8 * y + x of `used` (not 0) is set. Fills in the
// others: with the used ones' mean, then smoothed (low-pass extrapolation, ISO/IEC 14496-2).
void pad_block(uint8_t* block, size_t stride, uint64_t used);

uint8_t block_mean(const uint8_t* block, size_t stride);

void fill_block(uint8_t* block, size_t stride, uint8_t value);

}  // namespace tessera::codec
