// What the client knows of the scene, in the form its GPU reads: one 32-byte record a triangle.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "base/math.h"
#include "geometry-compression/meta_frame.h"

namespace tessera::client {

// Two texels of four numbers. Fields by bit, least significant first:
//   vertices: ids of the three corners;  object (24) | corner kind (3) | transposed | masked | reversed |
//   single colour (1)
//   shape:
//     block:  x (16) | y (16);  width (16) | height (16);  spacing codes of the three corners (8 each);  0
//     L:      x / 2 (12) | y / 2 (12) | level - 1 (6) | turned | split;
//             splits (8) | next y / 2 (12), if split;  spacing as above;  0
//     halves: x (13) | y / 2 (12) | turned | apex (2), of half 0;
//             x (13) | y / 2 (12) | turned | foot (6), of half 1;
//             spacing as above;  across - 1 (7) | along - 1 (10), half 0 | along - 1 (10), half 1
//     colour: 0xBBGGRR;  0;  0;  0
// Corner kind: 0 = lone triangle; 1, 2 = of a pair; 3, 4, 5 = of three; 6 = an L; 7 = halves. It belongs to
// the stored order of the vertices. Reversed: the corners are visited in the order 0, 2, 1, which undoes the
// winding of a mirrored object; vertices, block coordinates and spacing swap together, so the corner kind
// needs no mirrored twin. So what tells one triangle from another is 4 bytes for an L and 13 for halves, and
// two of spacing.
struct TriangleRecord {
  std::array<uint32_t, 4> vertices{}, shape{};
  bool operator==(const TriangleRecord&) const = default;
};
static_assert(sizeof(TriangleRecord) == 32);

constexpr uint8_t kCornerL = 6, kCornerHalves = 7;  // kinds

// The fields of a record, apart.
struct TriangleFields {
  std::array<uint32_t, 3> vertices{};
  uint32_t object = 0;
  uint8_t corner_kind = 0;
  bool transposed = false, masked = false, reversed = false;
  bool single_color = false;
  uint16_t x = 0, y = 0, width = 0, height = 0;  // of a block; x and y also of an L
  std::array<int8_t, 3> spacing{};     // but of a single colour, a corner of the triangle (meta_frame.h)
  geometry_compression::LPlacement l;  // with kCornerL
  geometry_compression::HalvesPlacement halves;  // with kCornerHalves
  uint32_t rgb = 0;                              // of a single colour: 0xBBGGRR
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
