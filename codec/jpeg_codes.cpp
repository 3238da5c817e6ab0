#include "codec/jpeg_codes.h"

#include <algorithm>

namespace tessera::codec {
namespace {

constexpr uint32_t kLongest = 16;
using Lengths = std::array<uint32_t, 256>;  // 0: no code

Lengths lengths_of(const JpegCode& code) {
  Lengths lengths{};
  size_t at = 0;
  for (uint32_t length = 1; length <= kLongest; ++length)
    for (uint32_t i = 0; i < code.counts[length]; ++i) lengths[code.symbols[at++]] = length;
  return lengths;
}

// F.1.2.1.2: 12 sizes of a difference. F.1.2.2.1: a run of 0..15 zeros and a size of 1..10, or the end of the
// block, or a run of 16.
bool exists(uint32_t symbol, JpegCodeKind kind) {
  const uint32_t size = symbol & 15;
  if (kind == JpegCodeKind::dc) return symbol <= 11;
  return (size >= 1 && size <= 10) || symbol == 0x00 || symbol == 0xf0;
}

// In units of the longest codes. All codes together must leave one of these free (C.2: no code is all ones).
uint32_t space(uint32_t length) {
  return 1u << (kLongest - length);
}
constexpr uint32_t kAllSpace = (1u << kLongest) - 1;

}  // namespace

JpegCode completed(const JpegCode& code, JpegCodeKind kind) {
  Lengths lengths = lengths_of(code);
  uint32_t taken = 0;
  for (uint32_t symbol = 0; symbol < lengths.size(); ++symbol) {
    if (lengths[symbol] == 0 && exists(symbol, kind)) lengths[symbol] = kLongest;
    if (lengths[symbol] != 0) taken += space(lengths[symbol]);
  }
  // The rarest symbols pay, as far as that is enough.
  for (uint32_t length = kLongest - 1; length >= 1 && taken > kAllSpace; --length)
    for (uint32_t& own : lengths) {
      if (own != length || taken <= kAllSpace) continue;
      ++own;
      taken -= space(own);
    }

  JpegCode out;
  size_t at = 0;
  for (uint32_t length = 1; length <= kLongest; ++length)
    for (uint32_t symbol = 0; symbol < lengths.size(); ++symbol) {
      if (lengths[symbol] != length) continue;
      out.symbols[at++] = static_cast<uint8_t>(symbol);
      ++out.counts[length];
    }
  return out;
}

}  // namespace tessera::codec
