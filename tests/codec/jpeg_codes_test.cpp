#include "codec/jpeg_codes.h"

#include <gtest/gtest.h>

#include <initializer_list>
#include <numeric>
#include <set>

namespace tessera::codec {
namespace {

// Symbols with one code length each.
JpegCode code_with(std::initializer_list<std::pair<uint8_t, uint8_t>> lengths) {
  JpegCode code;
  size_t at = 0;
  for (uint8_t length = 1; length <= 16; ++length)
    for (const auto& [symbol, own] : lengths)
      if (own == length) code.symbols[at++] = symbol, ++code.counts[length];
  return code;
}

// Each symbol once, and room for all without a code of ones alone (Kraft).
void expect_good(const JpegCode& code, size_t symbols) {
  EXPECT_EQ(std::accumulate(code.counts.begin(), code.counts.end(), size_t{0}), symbols);
  EXPECT_EQ(std::set<uint8_t>(code.symbols.begin(), code.symbols.begin() + symbols).size(), symbols);
  uint32_t taken = 0;
  for (uint32_t length = 1; length <= 16; ++length) taken += uint32_t{code.counts[length]} << (16 - length);
  EXPECT_LT(taken, 1u << 16);
}

uint32_t length_of(const JpegCode& code, uint8_t symbol) {
  size_t at = 0;
  for (uint32_t length = 1; length <= 16; ++length)
    for (uint32_t i = 0; i < code.counts[length]; ++i)
      if (code.symbols[at++] == symbol) return length;
  return 0;
}

TEST(JpegCodes, EverySymbolGetsACode) {
  for (const JpegCode& code : {code_with({}), code_with({{0, 1}}), code_with({{0, 1}, {1, 2}}),
                               code_with({{0, 1}, {1, 2}, {2, 3}, {3, 4}, {4, 5}, {5, 6}, {6, 7}, {7, 8}})}) {
    expect_good(completed(code, JpegCodeKind::dc), 12);
    expect_good(completed(code_with({{0x00, 1}, {0x01, 2}, {0x11, 3}}), JpegCodeKind::ac), 162);
  }
  // Of the shape of annex K.3.3.2: nothing is free.
  JpegCode full;
  full.counts = {0, 1, 0, 1, 3, 3, 2, 4, 3, 5, 5, 4, 4, 0, 0, 1, 125};
  size_t at = 0;
  for (uint32_t symbol = 0; symbol < 256; ++symbol)
    if ((symbol & 15) <= 10 && (symbol & 15) > 0) full.symbols[at++] = static_cast<uint8_t>(symbol);
  full.symbols[at++] = 0x00;
  expect_good(completed(full, JpegCodeKind::ac), 162);
}

TEST(JpegCodes, FrequentSymbolsKeepTheirCodes) {
  const JpegCode code = code_with({{0x00, 1},
                                   {0x01, 2},
                                   {0x11, 3},
                                   {0x02, 4},
                                   {0x21, 5},
                                   {0x31, 6},
                                   {0x41, 7},
                                   {0x12, 8},
                                   {0x51, 9},
                                   {0x61, 9}});
  const JpegCode all = completed(code, JpegCodeKind::ac);
  for (const uint8_t symbol : {0x00, 0x01, 0x11, 0x02, 0x21})
    EXPECT_EQ(length_of(all, symbol), length_of(code, symbol)) << int{symbol};
  EXPECT_EQ(length_of(all, 0xf0), 16u);
}

TEST(JpegCodes, ACompleteCodeStaysAsItIs) {
  const JpegCode all = completed(code_with({{0, 2}, {1, 2}, {2, 3}}), JpegCodeKind::dc);
  const JpegCode again = completed(all, JpegCodeKind::dc);
  EXPECT_EQ(again.counts, all.counts);
  EXPECT_EQ(again.symbols, all.symbols);
}

}  // namespace
}  // namespace tessera::codec
