#include "client-sdk/scene_state.h"

namespace tessera::client {
namespace {

constexpr uint32_t kVertexBits = 22;
constexpr uint32_t kVertexMask = (1u << kVertexBits) - 1;
constexpr uint32_t kSingleColor = 1u << 31;

uint32_t pack_block(const TriangleFields& f) {
  return f.x / 2u | f.y / 2u << 12 | (f.log_w - 1u) << 24 | (f.log_h - 1u) << 27;
}

}  // namespace

TriangleRecord pack(const TriangleFields& f) {
  TriangleRecord record;
  record.a = f.vertices[0] | uint32_t{f.corner_kind} << 22 | uint32_t{f.transposed} << 25 |
             uint32_t{f.masked} << 26 | uint32_t{f.reversed} << 27;
  record.b = f.vertices[1] | f.object << kVertexBits;
  record.c = f.vertices[2] | f.object >> 10 << kVertexBits;
  record.d = f.single_color ? f.rgb | kSingleColor : pack_block(f);
  return record;
}

TriangleFields unpack(const TriangleRecord& r) {
  TriangleFields f;
  f.vertices = {r.a & kVertexMask, r.b & kVertexMask, r.c & kVertexMask};
  f.object = r.b >> kVertexBits | r.c >> kVertexBits << 10;
  f.corner_kind = r.a >> 22 & 7;
  f.transposed = r.a >> 25 & 1;
  f.masked = r.a >> 26 & 1;
  f.reversed = r.a >> 27 & 1;
  f.single_color = (r.d & kSingleColor) != 0;
  if (f.single_color) {
    f.rgb = r.d & 0xffffff;
  } else {
    f.x = static_cast<uint16_t>((r.d & 0xfff) * 2);
    f.y = static_cast<uint16_t>((r.d >> 12 & 0xfff) * 2);
    f.log_w = static_cast<uint8_t>((r.d >> 24 & 7) + 1);
    f.log_h = static_cast<uint8_t>((r.d >> 27 & 7) + 1);
  }
  return f;
}

}  // namespace tessera::client
