// What the client knows of the scene, in the form its GPU reads: one 16-byte record a triangle
// (docs/protocol.md).
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "base/math.h"
#include "geometry-compression/meta_frame.h"

namespace tessera::client {

// Vertex ids below 2^22, objects below 2^20. Fields by bit, least significant first:
//   a: vertex0 (22) | corner kind (3) | transposed (1) | masked (1) | reversed (1)
//   b: vertex1 (22) | object bits 0..9 (10)
//   c: vertex2 (22) | object bits 10..19 (10)
//   d: block: x/2 (12) | y/2 (12) | log_w (3, minus 1) | log_h (3, minus 1) | 0 (2);  colour: 0xBBGGRR (24) |
//   0 (7) | 1
// Corner kind: 0 = lone triangle; 1, 2 = of a pair; 3, 4, 5 = of three. It belongs to the stored order of the
// vertices. Reversed: the corners are visited in the order 0, 2, 1, which undoes the winding of a mirrored
// object; vertices and block coordinates swap together, so the corner kind needs no mirrored twin.
struct TriangleRecord {
  uint32_t a, b, c, d;
  bool operator==(const TriangleRecord&) const = default;
};
static_assert(sizeof(TriangleRecord) == 16);

// The fields of a record, apart.
struct TriangleFields {
  std::array<uint32_t, 3> vertices{};
  uint32_t object = 0;
  uint8_t corner_kind = 0;
  bool transposed = false, masked = false, reversed = false;
  bool single_color = false;
  uint16_t x = 0, y = 0;         // of a block; even, < 8192
  uint8_t log_w = 1, log_h = 1;  // of a block; 1..8
  uint32_t rgb = 0;              // of a single colour: 0xBBGGRR
  bool operator==(const TriangleFields&) const = default;
};
TriangleRecord pack(const TriangleFields& fields);
TriangleFields unpack(const TriangleRecord& record);

struct ObjectState {
  geometry_compression::Transform transform;
  bool mirrored = false, double_sided = false, masked = false;
};

// Draw order groups: one draw call each, with its own culling and blending state.
enum class RecordGroup : uint8_t { single_sided, double_sided, masked_single_sided, masked_double_sided };
constexpr int kRecordGroups = 4;

// The state after the meta packet of `frame`. Kept by SceneStore; copied into a Pair when its atlas has
// arrived. Within an epoch vertices and objects are only appended.
struct SceneState {
  uint32_t frame = 0;
  uint16_t atlas_width = 0, atlas_height = 0;
  uint32_t epoch = 0;                // grows with every full_state: everything is new
  std::vector<vec3> vertices;        // mesh space (dequantised), by vertex id
  std::vector<ObjectState> objects;  // by object id
  std::array<std::vector<TriangleRecord>, kRecordGroups> records;  // of visible patches
};

}  // namespace tessera::client
