// The client's own copy of the scene, kept current by meta frames. A frame costs time in proportion to what
// it changes.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "client-sdk/scene_state.h"
#include "geometry-compression/meta_frame.h"

namespace tessera::client {

class SceneStore {
 public:
  // `frame` has passed MetaChecker::check(); frames come in order, each once.
  void apply(const geometry_compression::MetaFrame& frame);
  const SceneState& state() const { return state_; }
  // Brings an earlier copy (or an empty state) up to date; reuses its memory and copies only vertices that it
  // lacks.
  void copy_to(SceneState& copy) const;

 private:
  static constexpr uint32_t kNoRecord = 0xffffffffu;
  struct Patch {
    uint32_t object;
    uint8_t triangles;
    std::array<uint32_t, 5> vertices;
    // Index of each triangle's record in its group, or kNoRecord while it is not placed.
    std::array<uint32_t, 3> records{kNoRecord, kNoRecord, kNoRecord};
  };
  using Placement = geometry_compression::PatchPlacement;

  void forget_everything();
  void append(const geometry_compression::MetaFrame& frame);
  void place(const Placement& placement);
  void place_triangle(const Placement& placement, uint32_t triangle, TriangleFields fields);
  void remove_records(Patch& patch);
  int group_of(const Patch& patch) const;

  SceneState state_;
  std::vector<geometry_compression::NewMesh> meshes_;
  std::vector<Patch> patches_;
  // Who a record belongs to: patch << 2 | triangle. A record that is removed is replaced by the last of its
  // group.
  std::array<std::vector<uint32_t>, kRecordGroups> owners_;
};

}  // namespace tessera::client
