// One 4:2:0 picture ⇄ one baseline JPEG (ISO/IEC 10918-1), planes as they are: no colour conversion. All of
// libjpeg lies behind this file, and its errors end here.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/status.h"
#include "base/yuv.h"
#include "codec/jpeg_codes.h"

namespace tessera::codec {

// Luma's quantisers are those of the standard's annex K times a scale (1 is libjpeg's quality 50), chroma's
// are all alike.
constexpr double kFinestScale = 0.1, kCoarsestScale = 20;

// Not thread-safe; one for each thread.
class JpegCompressor {
 public:
  JpegCompressor();
  ~JpegCompressor();
  JpegCompressor(JpegCompressor&&) noexcept;

  struct Fitted {
    JpegCodes codes;
    size_t bytes = 0;  // of the picture with codes that need not be able to code any other
  };
  // Pictures have sides that are multiples of 16. The codes that suit this one best, and can code any other.
  StatusOr<Fitted> codes_for(const YuvImage& picture, double scale);
  // What tiles have in common, in the standard's abbreviated format for table specifications.
  StatusOr<std::vector<uint8_t>> tables(double scale, const JpegCodes& codes);
  // The picture without them (abbreviated format for compressed data).
  StatusOr<std::vector<uint8_t>> compress(const YuvImage& picture, double scale, const JpegCodes& codes);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Safe for untrusted input. Not thread-safe; one for each thread.
class JpegDecompressor {
 public:
  JpegDecompressor();
  ~JpegDecompressor();
  JpegDecompressor(JpegDecompressor&&) noexcept;

  // Fills `picture`, whose size is the one expected: multiples of 16. InvalidArgument: damaged, cut short, of
  // another size or kind.
  Status decompress(std::span<const uint8_t> tables, std::span<const uint8_t> tile, YuvImage& picture);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::codec
