// Made-up H.264 for tests: right as far as RTP looks into it.
#pragma once

#include <cstdint>
#include <random>
#include <span>
#include <string_view>
#include <vector>

namespace tessera::transport::test {

using Bytes = std::vector<uint8_t>;

// "80 60 00 01" → bytes; blanks are ignored.
Bytes from_hex(std::string_view hex);

// A NAL unit of `bytes` bytes (>= 2) with random content, without start codes inside, that ends in a non-zero
// byte.
Bytes make_nal(uint8_t type, size_t bytes, std::mt19937_64& random);

// Annex B with four-byte start codes.
Bytes join(const std::vector<Bytes>& nals);

// SPS, PPS and an IDR slice, or one P slice; `bytes` for the slice.
Bytes make_access_unit(bool key_frame, size_t bytes, std::mt19937_64& random);

}  // namespace tessera::transport::test
