// What the client must know beside the atlas to draw frame N: new meshes, vertices, objects and patches,
// moved objects, and changed placements. Plain values; bits in meta_codec.h; format in docs/meta-format.md.
// Standard library only.
//
// Ids are dense and count from 0 in order of transmission, so new things carry no id. The client keeps
// everything that it was ever sent in a session; a patch that is not visible has placement kind `none`.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace tessera::geometry_compression {

// A set of vertices in its own space: position = offset + step * q.
struct NewMesh {
  std::array<double, 3> offset{};
  double step = 1;  // > 0
  bool operator==(const NewMesh&) const = default;
};

struct NewVertex {
  uint32_t mesh = 0;
  std::array<int32_t, 3> q{};  // |q| < 2^30
  bool operator==(const NewVertex&) const = default;
};

// Mesh space to world, column-major 3x3 and a translation.
struct Transform {
  std::array<float, 9> linear{1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::array<double, 3> translation{};
  bool operator==(const Transform&) const = default;
};

struct NewObject {
  Transform transform;
  bool mirrored = false;  // the transform reverses the winding
  bool double_sided = false;
  bool masked = false;  // its patches have coverage
  bool operator==(const NewObject&) const = default;
};

struct MovedObject {
  uint32_t object = 0;
  Transform transform;
  bool operator==(const MovedObject&) const = default;
};

// Vertices in the order of the block's corners (scene::Patch): 3, 4 or 5 of them:
//   1 triangle: (0,0) (1,0) (0,1)   2: + (1,1)   3: (0,0) (1,0) (.5,1) (0,1) (1,1)
struct NewPatch {
  uint32_t object = 0;
  uint8_t triangles = 1;               // 1..3
  std::array<uint32_t, 5> vertices{};  // vertex ids; the first triangles + 2 are used, the rest 0
  bool operator==(const NewPatch&) const = default;
};

constexpr uint16_t kMaxBlockSide = 256;

constexpr uint8_t kMaxLevel = 64, kMaxSplits = 31;
constexpr uint8_t kMaxHalfWidth = 128;
constexpr uint16_t kMaxHalfLength = 1024;
constexpr uint8_t kFeet = 64;

enum class PlacementKind : uint8_t { none = 0, block = 1, color = 2, l = 3, halves = 4 };

// Kind l (L-packing), at the x and y of the placement: of its pair of Ls.
struct LPlacement {
  uint8_t level = 0;    // 1..kMaxLevel
  uint8_t splits = 0;   // 1..kMaxSplits: splits^2 Ls, which go on at next_y after the end of the row
  bool turned = false;  // the first is the second of its pair
  uint16_t next_y = 0;  // even, < 8192; 0 with splits = 1
  bool operator==(const LPlacement&) const = default;
};

// Kind halves (Oversampling).
struct HalfPlacement {
  uint16_t x = 0, y = 0;  // < 8192, y even
  uint16_t along = 0;     // intervals between samples along the base: 1..kMaxHalfLength
  bool turned = false;
  bool operator==(const HalfPlacement&) const = default;
};
struct HalvesPlacement {
  uint8_t apex = 0;    // corner of the triangle opposite the base: 0..2
  uint8_t foot = 0;    // of the height, on the base: 0..kFeet - 1
  uint8_t across = 0;  // intervals along the height: 1..kMaxHalfWidth
  std::array<HalfPlacement, 2> half{};
  bool operator==(const HalvesPlacement&) const = default;
};

struct PatchPlacement {
  uint32_t patch = 0;  // below 2^30 where a placement of the frame has a part
  // 0: the whole patch (kinds none, block, color); 1..3: the first to third of its triangles (color, l,
  // halves).
  uint8_t part = 0;
  PlacementKind kind = PlacementKind::none;
  // Kinds block and l. Texels: x and y even, < 8192. Kind block: width and height even, 2..kMaxBlockSide.
  uint16_t x = 0, y = 0;
  uint16_t width = 0, height = 0;
  bool transposed = false;
  // Kind block: of corners 1..4; l and halves: of the triangle's corners 1 and 2, then 0: log2 of the
  // corner's distance from the eye that the placement was made for, over that of corner 0, in 21 steps an
  // octave; -126..126. 0 for corners that the patch has not.
  std::array<int8_t, 4> spacing{};
  LPlacement l;
  HalvesPlacement halves;
  uint32_t rgb = 0;  // kind color: 0xBBGGRR, sRGB
  bool operator==(const PatchPlacement&) const = default;
};

struct MetaFrame {
  uint32_t frame = 0;
  uint32_t rtp_timestamp = 0;
  uint16_t atlas_width = 0, atlas_height = 0;  // even, <= 8192
  bool full_state = false;  // the client forgets everything before applying this one (first frame, resume)
  std::vector<NewMesh> meshes;
  std::vector<NewVertex> vertices;
  std::vector<NewObject> objects;
  std::vector<MovedObject> moved;  // sorted by object
  std::vector<NewPatch> patches;
  std::vector<PatchPlacement> placements;  // sorted by patch and part, each once
  bool operator==(const MetaFrame&) const = default;
};

}  // namespace tessera::geometry_compression
