// A column: the values of one field over all items of a section, cut into runs of kRunLength. Each run has
// its own code, the cheapest, named by a header: exp-Golomb of some order; plain numbers of a few bits, for
// kinds and flags; or none, when all its values are 0.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "geometry-compression/bit_io.h"

namespace tessera::geometry_compression {

constexpr uint32_t kRunLength = 64;
constexpr uint32_t kCodeBits = 5;
// Codes up to kLastOrder are exp-Golomb of that order, those above it plain numbers of 1, 2, … bits.
constexpr uint32_t kLastOrder = 24;
constexpr uint32_t kAllZeros = 31;

void write_column(BitWriter& out, std::span<const uint32_t> values);

// Reads `count` values; memory grows with the runs that are really there. On failure (in.ok() false) the
// column is shorter.
std::vector<uint32_t> read_column(BitReader& in, uint32_t count);

// A column of few distinct neighbours as (length - 1, zigzag delta to the run before) columns: vertices of
// one mesh, patches of one object. The second function returns false if the runs do not add up to `count`.
void write_repeats(BitWriter& out, std::span<const uint32_t> values);
bool read_repeats(BitReader& in, uint32_t count,
                  const std::function<void(uint32_t length, uint32_t value)>& on_run);

// Differences wrap modulo 2^32, so every pair of values has one.
constexpr uint32_t delta(uint32_t value, uint32_t base) {
  return zigzag(static_cast<int32_t>(value - base));
}
constexpr uint32_t undelta(uint32_t coded, uint32_t base) {
  return base + static_cast<uint32_t>(unzigzag(coded));
}

}  // namespace tessera::geometry_compression
