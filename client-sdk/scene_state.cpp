#include "client-sdk/scene_state.h"

namespace tessera::client {
namespace {

constexpr uint32_t kObjectBits = 24;
constexpr uint32_t kObjectMask = (1u << kObjectBits) - 1;
constexpr uint32_t kTransposed = 1u << 27, kMasked = 1u << 28, kReversed = 1u << 29, kSingleColor = 1u << 30;

using geometry_compression::HalfPlacement;

uint32_t pack_spacing(const TriangleFields& f) {
  uint32_t spacing = 0;
  for (size_t i = 0; i < f.spacing.size(); ++i)
    spacing |= uint32_t{static_cast<uint8_t>(f.spacing[i])} << (8 * i);
  return spacing;
}

std::array<uint32_t, 4> pack_block(const TriangleFields& f) {
  return {f.x | uint32_t{f.y} << 16, f.width | uint32_t{f.height} << 16, pack_spacing(f), 0};
}

std::array<uint32_t, 4> pack_l(const TriangleFields& f) {
  const bool split = f.l.splits > 1;
  return {
      f.x / 2u | f.y / 2u << 12 | (f.l.level - 1u) << 24 | uint32_t{f.l.turned} << 30 | uint32_t{split} << 31,
      split ? f.l.splits | f.l.next_y / 2u << 8 : 0, pack_spacing(f), 0};
}

uint32_t pack_half(const HalfPlacement& half) {
  return half.x | half.y / 2u << 13 | uint32_t{half.turned} << 25;
}

std::array<uint32_t, 4> pack_halves(const TriangleFields& f) {
  const auto& h = f.halves;
  return {pack_half(h.half[0]) | uint32_t{h.apex} << 26, pack_half(h.half[1]) | uint32_t{h.foot} << 26,
          pack_spacing(f), (h.across - 1u) | (h.half[0].along - 1u) << 7 | (h.half[1].along - 1u) << 17};
}

std::array<uint32_t, 4> pack_shape(const TriangleFields& f) {
  if (f.single_color) return {f.rgb, 0, 0, 0};
  if (f.corner_kind == kCornerL) return pack_l(f);
  return f.corner_kind == kCornerHalves ? pack_halves(f) : pack_block(f);
}

void unpack_l(const TriangleRecord& r, TriangleFields& f) {
  const auto& [place, split, spacing, unused] = r.shape;
  f.x = static_cast<uint16_t>(2 * (place & 0xfff));
  f.y = static_cast<uint16_t>(2 * (place >> 12 & 0xfff));
  f.l.level = static_cast<uint8_t>((place >> 24 & 63) + 1);
  f.l.turned = (place >> 30 & 1) != 0;
  f.l.splits = place >> 31 ? static_cast<uint8_t>(split) : uint8_t{1};
  f.l.next_y = static_cast<uint16_t>(2 * (split >> 8));
}

void unpack_halves(const TriangleRecord& r, TriangleFields& f) {
  for (size_t i = 0; i < 2; ++i) {
    HalfPlacement& half = f.halves.half[i];
    half.x = static_cast<uint16_t>(r.shape[i] & 0x1fff);
    half.y = static_cast<uint16_t>(2 * (r.shape[i] >> 13 & 0xfff));
    half.turned = (r.shape[i] >> 25 & 1) != 0;
    half.along = static_cast<uint16_t>((r.shape[3] >> (7 + 10 * i) & 0x3ff) + 1);
  }
  f.halves.apex = static_cast<uint8_t>(r.shape[0] >> 26);
  f.halves.foot = static_cast<uint8_t>(r.shape[1] >> 26);
  f.halves.across = static_cast<uint8_t>((r.shape[3] & 0x7f) + 1);
}

void unpack_block(const TriangleRecord& r, TriangleFields& f) {
  f.x = static_cast<uint16_t>(r.shape[0]);
  f.y = static_cast<uint16_t>(r.shape[0] >> 16);
  f.width = static_cast<uint16_t>(r.shape[1]);
  f.height = static_cast<uint16_t>(r.shape[1] >> 16);
}

}  // namespace

TriangleRecord pack(const TriangleFields& f) {
  TriangleRecord record;
  for (int i = 0; i < 3; ++i) record.vertices[i] = f.vertices[i];
  record.vertices[3] = f.object | uint32_t{f.corner_kind} << kObjectBits | (f.transposed ? kTransposed : 0) |
                       (f.masked ? kMasked : 0) | (f.reversed ? kReversed : 0) |
                       (f.single_color ? kSingleColor : 0);
  record.shape = pack_shape(f);
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
  for (size_t i = 0; i < f.spacing.size(); ++i) f.spacing[i] = static_cast<int8_t>(r.shape[2] >> (8 * i));
  if (f.corner_kind == kCornerL) {
    unpack_l(r, f);
  } else if (f.corner_kind == kCornerHalves) {
    unpack_halves(r, f);
  } else {
    unpack_block(r, f);
  }
  return f;
}

}  // namespace tessera::client
