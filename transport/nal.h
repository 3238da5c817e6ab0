// The H.264 NAL units that RTP carries (RFC 6184). Safe for untrusted input.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace tessera::transport {

// A NAL unit: its header byte, then its payload with emulation prevention; no start code. Never empty.
using Nal = std::span<const uint8_t>;

constexpr uint8_t kNalIdrSlice = 5, kNalSps = 7, kNalPps = 8, kNalDelimiter = 9;
constexpr uint8_t kNalStapA = 24, kNalFuA = 28;  // RFC 6184 table 1

inline uint8_t nal_type(Nal nal) {
  return nal[0] & 0x1f;
}

// The units of a byte stream (H.264 annex B), without start codes and trailing zeros.
std::vector<Nal> split_annex_b(std::span<const uint8_t> stream);

// Appends a four-byte start code and the unit.
void append_annex_b(std::vector<uint8_t>& stream, Nal nal);

}  // namespace tessera::transport
