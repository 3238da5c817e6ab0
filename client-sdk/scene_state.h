// What the client knows of the scene, in the form its GPU reads: one 16-byte record a triangle (docs/protocol.md).
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "base/math.h"
#include "geometry-compression/meta_frame.h"

namespace tessera::client {

// Vertex ids below 2^22, objects below 2^20. Fields by bit, least significant first:
//   a: vertex0 (22) | corner kind (3) | transposed (1) | masked (1)
//   b: vertex1 (22) | object bits 0..9 (10)
//   c: vertex2 (22) | object bits 10..19 (10)
//   d: block: x/2 (12) | y/2 (12) | log_w (3, minus 1) | log_h (3, minus 1) | 0 (2);  colour: 0xBBGGRR (24) | 0 (7) | 1
// Corner kind: 0 = lone triangle; 1, 2 = of a pair; 3, 4, 5 = of three.
struct TriangleRecord {
  uint32_t a, b, c, d;
};
static_assert(sizeof(TriangleRecord) == 16);

struct ObjectState {
  geometry_compression::Transform transform;
  bool mirrored = false, double_sided = false, masked = false;
};

// Draw order groups: one draw call each, with its own culling and blending state.
enum class RecordGroup : uint8_t { single_sided, double_sided, masked_single_sided, masked_double_sided };
constexpr int kRecordGroups = 4;

// Grows by apply(); copied into a Pair when its atlas has arrived (vertices are appended only, so the display uploads
// just the new ones).
struct SceneState {
  uint32_t frame = 0;
  uint16_t atlas_width = 0, atlas_height = 0;
  uint32_t epoch = 0;  // grows with every full_state: everything is new
  std::vector<vec3> vertices;        // mesh space (dequantised), by vertex id
  std::vector<ObjectState> objects;  // by object id
  std::array<std::vector<TriangleRecord>, kRecordGroups> records;  // of visible patches; winding already undone for mirrored objects
};

}  // namespace tessera::client
