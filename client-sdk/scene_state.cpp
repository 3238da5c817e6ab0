#include "client-sdk/scene_state.h"

namespace tessera::client {
namespace {

constexpr uint32_t kObjectBits = 24;
constexpr uint32_t kObjectMask = (1u << kObjectBits) - 1;
constexpr uint32_t kTransposed = 1u << 27, kMasked = 1u << 28, kReversed = 1u << 29, kSingleColor = 1u << 30;

std::array<uint32_t, 4> pack_block(const TriangleFields& f) {
  uint32_t spacing = 0;
  for (size_t i = 0; i < f.spacing.size(); ++i)
    spacing |= uint32_t{static_cast<uint8_t>(f.spacing[i])} << (8 * i);
  return {f.x | uint32_t{f.y} << 16, f.width | uint32_t{f.height} << 16, spacing, 0};
}

}  // namespace

TriangleRecord pack(const TriangleFields& f) {
  TriangleRecord record;
  for (int i = 0; i < 3; ++i) record.vertices[i] = f.vertices[i];
  record.vertices[3] = f.object | uint32_t{f.corner_kind} << kObjectBits | (f.transposed ? kTransposed : 0) |
                       (f.masked ? kMasked : 0) | (f.reversed ? kReversed : 0) |
                       (f.single_color ? kSingleColor : 0);
  record.shape = f.single_color ? std::array{f.rgb, 0u, 0u, 0u} : pack_block(f);
  return record;
}

TriangleFields unpack(const TriangleRecord& r) {
  TriangleFields f;
  const uint32_t what = r.vertices[3];
  f.vertices = {r.vertices[0], r.vertices[1], r.vertices[2]};
  f.object = what & kObjectMask;
  f.corner_kind = what >> kObjectBits & 7;
  f.transposed = (what & kTransposed) != 0;
  f.masked = (what & kMasked) != 0;
  f.reversed = (what & kReversed) != 0;
  f.single_color = (what & kSingleColor) != 0;
  if (f.single_color) {
    f.rgb = r.shape[0];
    return f;
  }
  f.x = static_cast<uint16_t>(r.shape[0]);
  f.y = static_cast<uint16_t>(r.shape[0] >> 16);
  f.width = static_cast<uint16_t>(r.shape[1]);
  f.height = static_cast<uint16_t>(r.shape[1] >> 16);
  for (size_t i = 0; i < f.spacing.size(); ++i) f.spacing[i] = static_cast<int8_t>(r.shape[2] >> (8 * i));
  return f;
}

}  // namespace tessera::client
