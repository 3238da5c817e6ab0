// The Huffman codes of baseline JPEG (ISO/IEC 10918-1, C and F.1.2).
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace tessera::codec {

// Codes in the standard's form: how many there are of each length, and their symbols by ascending length.
struct JpegCode {
  std::array<uint8_t, 17> counts{};  // [length], 1..16
  std::array<uint8_t, 256> symbols{};
};
struct JpegCodes {
  std::array<JpegCode, 2> dc, ac;  // luma, chroma
};

// What a symbol means, and so which ones there are.
enum class JpegCodeKind { dc, ac };

// A code made for some blocks, so that it can code any: symbols that those did not have get the longest
// codes, and some of the rare ones a bit more to make room.
JpegCode completed(const JpegCode& code, JpegCodeKind kind);

}  // namespace tessera::codec
