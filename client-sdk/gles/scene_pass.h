// The one drawing pass: every triangle of a SceneState from its record, textured with the atlas.
#pragma once

#include <array>
#include <vector>

#include "base/view.h"
#include "client-sdk/gles/atlas_texture.h"
#include "client-sdk/gles/table_texture.h"
#include "client-sdk/scene_state.h"

namespace tessera::client::gles {

// What a framebuffer does with what is drawn into it.
struct TargetKind {
  bool multisampled = false;  // several samples a pixel, so that alpha can become coverage
  bool srgb = false;          // encodes colours itself, so that it must be given linear ones
};

class ScenePass {
 public:
  // With `clip_control` depth is reversed straight from 0 to 1; without, the range -1 to 1 costs its
  // precision.
  static StatusOr<ScenePass> create(ClipControl clip_control);

  // Keeps a copy of the state on the device; uploads what changed.
  Status set_state(const SceneState& state);
  // Into the bound framebuffer, whose colour the caller has cleared; clears depth. Other state is as
  // StateScope leaves it.
  Status draw(const View& view, const AtlasTexture& atlas, const TargetKind& target);

 private:
  static TableTexture record_table() {
    return TableTexture({GL_RGBA32UI, GL_RGBA_INTEGER, GL_UNSIGNED_INT, sizeof(TriangleRecord) / 2});
  }

  ScenePass() = default;
  Status upload_transforms(const dvec3& eye);
  mat4 clip_from_relative(const View& view) const;
  void draw_group(RecordGroup group, bool multisampled);

  ClipControl clip_control_ = nullptr;
  Program program_;
  // Uniform locations.
  GLint clip_from_relative_ = -1, atlas_size_ = -1, masked_ = -1, multisampled_ = -1, srgb_target_ = -1;
  VertexArray no_attributes_;

  uint32_t atlas_width_ = 0, atlas_height_ = 0;  // of the state; 0 before the first
  std::vector<ObjectState> objects_;
  std::vector<vec4> relative_;  // what transforms_ gets
  TableTexture vertices_{{GL_RGB32F, GL_RGB, GL_FLOAT, sizeof(vec3)}};
  TableTexture transforms_{{GL_RGBA32F, GL_RGBA, GL_FLOAT, sizeof(vec4)}};
  std::array<TableTexture, kRecordGroups> records_{record_table(), record_table(), record_table(),
                                                   record_table()};
  std::array<GLsizei, kRecordGroups> record_counts_{};
};

}  // namespace tessera::client::gles
