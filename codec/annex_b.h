// H.264 as a byte stream (Annex B): its NAL units, and our SEI message that says which frame an access unit
// is and which one it builds on. Safe for untrusted input.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/frame_number.h"

namespace tessera::codec {

enum class NalType : uint8_t { slice = 1, idr_slice = 5, sei = 6, sps = 7, pps = 8 };

// The bytes between two start codes, header byte first, without trailing zeros. Empty units are left out.
using Nal = std::span<const uint8_t>;
std::vector<Nal> split_nals(std::span<const uint8_t> access_unit);
inline NalType type_of(Nal nal) {
  return static_cast<NalType>(nal[0] & 31);
}

// Payload of the SEI message "user data unregistered" (type 5): kFrameUuid, then both numbers with the most
// significant byte first. Readers accept longer payloads.
struct FrameTag {
  FrameNumber frame = 0;
  FrameNumber reference = 0;  // the frame that this one is predicted from; key frames: `frame` itself
  bool operator==(const FrameTag&) const = default;
};
constexpr uint8_t kFrameUuid[16] = {0x5b, 0x1e, 0x8d, 0x40, 0x73, 0x9c, 0x4a, 0x62,
                                    0x9f, 0x27, 0x7e, 0x65, 0x73, 0x73, 0x72, 0x61};

// What the tag adds to an access unit at most, in bits: start code, headers, payload, escapes.
constexpr uint32_t kTagBits = 8 * 42;

// The same access unit with `tag` before its first slice, and without other SEI messages (encoders write
// banners there).
std::vector<uint8_t> with_tag(std::span<const uint8_t> access_unit, const FrameTag& tag);

// What an access unit is, as far as it can be told without decoding.
struct AccessUnitInfo {
  std::optional<FrameTag> tag;
  bool key_frame = false;  // has an IDR slice
  bool has_slice = false;
};
AccessUnitInfo inspect(std::span<const uint8_t> access_unit);

}  // namespace tessera::codec
