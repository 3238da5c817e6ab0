#include "client-sdk/gles/scene_pass.h"

#include <glm/gtc/type_ptr.hpp>
#include <span>

#include "atlas/addressing/glsl_text.h"
#include "client-sdk/gles/scene_shaders.h"
#include "client-sdk/gles/shared_shaders.h"

namespace tessera::client::gles {
namespace {

enum Unit : GLuint { kRecords, kVertices, kTransforms, kAtlas };

template <typename T>
std::span<const std::byte> bytes_of(const std::vector<T>& values) {
  return std::as_bytes(std::span(values));
}

}  // namespace

StatusOr<ScenePass> ScenePass::create(ClipControl clip_control) {
  ScenePass pass;
  pass.clip_control_ = clip_control;
  TESSERA_ASSIGN_OR_RETURN(pass.program_,
                           make_program({kScenePrelude, atlas::addressing::kGlslText, kSceneVertex},
                                        {kPicturePrelude, atlas::addressing::kGlslText, kSceneFragment}));
  set_sampler(pass.program_, "records", kRecords);
  set_sampler(pass.program_, "vertices", kVertices);
  set_sampler(pass.program_, "transforms", kTransforms);
  set_sampler(pass.program_, "atlas", kAtlas);
  const GLuint program = pass.program_.id();
  pass.clip_from_relative_ = glGetUniformLocation(program, "clip_from_relative");
  pass.atlas_size_ = glGetUniformLocation(program, "atlas_size");
  pass.masked_ = glGetUniformLocation(program, "masked");
  pass.multisampled_ = glGetUniformLocation(program, "multisampled");
  pass.srgb_target_ = glGetUniformLocation(program, "srgb_target");
  pass.no_attributes_ = make_vertex_array();
  TESSERA_RETURN_IF_ERROR(check_errors("creation of the scene pass"));
  return pass;
}

Status ScenePass::set_state(const SceneState& state) {
  TESSERA_RETURN_IF_ERROR(vertices_.update(bytes_of(state.vertices)));
  for (int group = 0; group < kRecordGroups; ++group) {
    TESSERA_RETURN_IF_ERROR(records_[group].update(bytes_of(state.records[group])));
    record_counts_[group] = static_cast<GLsizei>(state.records[group].size());
  }
  objects_ = state.objects;
  atlas_width_ = state.atlas_width;
  atlas_height_ = state.atlas_height;
  return absl::OkStatus();
}

Status ScenePass::upload_transforms(const dvec3& eye) {
  relative_.clear();
  for (const ObjectState& object : objects_) {
    const auto& m = object.transform.linear;  // column-major
    for (int row = 0; row < 3; ++row) {
      // The one subtraction of large numbers, in double.
      const double offset = object.transform.translation[row] - eye[row];
      relative_.push_back(vec4(m[row], m[3 + row], m[6 + row], static_cast<float>(offset)));
    }
  }
  return transforms_.update(bytes_of(relative_));
}

mat4 ScenePass::clip_from_relative(const View& view) const {
  mat4 clip = view_projection(view, view.pose.position);
  if (clip_control_ == nullptr) {
    // Depth d of 1 (near) to 0 becomes 1 - 2d: -1 (near) to 1, OpenGL's default range.
    for (int column = 0; column < 4; ++column) clip[column].z = clip[column].w - 2 * clip[column].z;
  }
  return clip;
}

Status ScenePass::draw(const View& view, const AtlasTexture& atlas, const TargetKind& target) {
  glEnable(GL_DEPTH_TEST);
  glDepthMask(GL_TRUE);
  glDepthFunc(clip_control_ != nullptr ? GL_GREATER : GL_LESS);
  glClearDepthf(clip_control_ != nullptr ? 0.0f : 1.0f);
  glClear(GL_DEPTH_BUFFER_BIT);
  if (atlas_width_ == 0) return check_errors("clearing of the picture");
  if (atlas.width() != atlas_width_ || atlas.height() != atlas_height_) {
    return absl::FailedPreconditionError(
        absl::StrCat("the atlas is ", atlas.width(), "x", atlas.height(), ", but the state is of one of ",
                     atlas_width_, "x", atlas_height_, "; give set_atlas() and set_state() the same frame"));
  }
  TESSERA_RETURN_IF_ERROR(upload_transforms(view.pose.position));

  glUseProgram(program_.id());
  glUniformMatrix4fv(clip_from_relative_, 1, GL_FALSE, glm::value_ptr(clip_from_relative(view)));
  glUniform2f(atlas_size_, static_cast<float>(atlas.width()), static_cast<float>(atlas.height()));
  glUniform1i(multisampled_, target.multisampled ? 1 : 0);
  glUniform1i(srgb_target_, target.srgb ? 1 : 0);
  vertices_.bind(kVertices);
  transforms_.bind(kTransforms);
  atlas.bind(kAtlas);
  glBindVertexArray(no_attributes_.id());
  if (clip_control_ != nullptr) clip_control_(GL_LOWER_LEFT_EXT, GL_ZERO_TO_ONE_EXT);
  for (int group = 0; group < kRecordGroups; ++group)
    draw_group(static_cast<RecordGroup>(group), target.multisampled);
  if (clip_control_ != nullptr) clip_control_(GL_LOWER_LEFT_EXT, GL_NEGATIVE_ONE_TO_ONE_EXT);
  glDisable(GL_SAMPLE_ALPHA_TO_COVERAGE);
  return check_errors("drawing of the scene");
}

void ScenePass::draw_group(RecordGroup group, bool multisampled) {
  const int index = static_cast<int>(group);
  if (record_counts_[index] == 0) return;
  const bool masked = group == RecordGroup::masked_single_sided || group == RecordGroup::masked_double_sided;
  const bool double_sided = group == RecordGroup::double_sided || group == RecordGroup::masked_double_sided;
  const auto set = [](GLenum state, bool on) { on ? glEnable(state) : glDisable(state); };
  set(GL_CULL_FACE, !double_sided);
  set(GL_SAMPLE_ALPHA_TO_COVERAGE, masked && multisampled);
  glUniform1i(masked_, masked ? 1 : 0);
  records_[index].bind(kRecords);
  glDrawArrays(GL_TRIANGLES, 0, 3 * record_counts_[index]);
}

}  // namespace tessera::client::gles
