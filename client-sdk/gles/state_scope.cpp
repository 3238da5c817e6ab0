#include "client-sdk/gles/state_scope.h"

namespace tessera::client::gles {
namespace {

GLint integer(GLenum name) {
  GLint value = 0;
  glGetIntegerv(name, &value);
  return value;
}

void set_enabled(GLenum toggle, bool on) {
  on ? glEnable(toggle) : glDisable(toggle);
}

GLuint name_of(GLint value) {
  return static_cast<GLuint>(value);
}
GLenum enum_of(GLint value) {
  return static_cast<GLenum>(value);
}

}  // namespace

StateScope::StateScope(ClipControl clip_control) : clip_control_(clip_control) {
  save();
  neutralise();
  if (clip_control_ != nullptr) clip_control_(GL_LOWER_LEFT_EXT, GL_NEGATIVE_ONE_TO_ONE_EXT);
}

void StateScope::save() {
  draw_framebuffer_ = integer(GL_DRAW_FRAMEBUFFER_BINDING);
  read_framebuffer_ = integer(GL_READ_FRAMEBUFFER_BINDING);
  renderbuffer_ = integer(GL_RENDERBUFFER_BINDING);
  program_ = integer(GL_CURRENT_PROGRAM);
  vertex_array_ = integer(GL_VERTEX_ARRAY_BINDING);
  unpack_buffer_ = integer(GL_PIXEL_UNPACK_BUFFER_BINDING);
  active_texture_ = integer(GL_ACTIVE_TEXTURE);
  for (GLuint i = 0; i < kTextureUnits; ++i) {
    glActiveTexture(GL_TEXTURE0 + i);
    units_[i] = {integer(GL_TEXTURE_BINDING_2D), integer(GL_SAMPLER_BINDING)};
  }
  for (size_t i = 0; i < kUnpackSettings.size(); ++i) unpack_[i] = integer(kUnpackSettings[i]);
  for (size_t i = 0; i < kToggles.size(); ++i) toggles_[i] = glIsEnabled(kToggles[i]);
  glGetIntegerv(GL_VIEWPORT, viewport_.data());
  glGetIntegerv(GL_SCISSOR_BOX, scissor_.data());
  glGetBooleanv(GL_COLOR_WRITEMASK, color_mask_.data());
  glGetFloatv(GL_COLOR_CLEAR_VALUE, clear_color_.data());
  glGetBooleanv(GL_DEPTH_WRITEMASK, &depth_mask_);
  glGetFloatv(GL_DEPTH_CLEAR_VALUE, &clear_depth_);
  glGetFloatv(GL_DEPTH_RANGE, depth_range_.data());
  depth_function_ = integer(GL_DEPTH_FUNC);
  cull_face_ = integer(GL_CULL_FACE_MODE);
  front_face_ = integer(GL_FRONT_FACE);
  if (clip_control_ == nullptr) return;
  clip_origin_ = integer(GL_CLIP_ORIGIN_EXT);
  clip_depth_ = integer(GL_CLIP_DEPTH_MODE_EXT);
}

void StateScope::neutralise() {
  for (const GLenum toggle : kToggles) glDisable(toggle);
  for (GLuint i = 0; i < kTextureUnits; ++i) glBindSampler(i, 0);
  for (const GLenum setting : kUnpackSettings) glPixelStorei(setting, setting == GL_UNPACK_ALIGNMENT ? 4 : 0);
  glBindBuffer(GL_PIXEL_UNPACK_BUFFER, 0);
  glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
  glDepthRangef(0, 1);
  glCullFace(GL_BACK);
  glFrontFace(GL_CCW);
}

StateScope::~StateScope() {
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, name_of(draw_framebuffer_));
  glBindFramebuffer(GL_READ_FRAMEBUFFER, name_of(read_framebuffer_));
  glBindRenderbuffer(GL_RENDERBUFFER, name_of(renderbuffer_));
  glUseProgram(name_of(program_));
  glBindVertexArray(name_of(vertex_array_));
  glBindBuffer(GL_PIXEL_UNPACK_BUFFER, name_of(unpack_buffer_));
  for (GLuint i = 0; i < kTextureUnits; ++i) {
    glActiveTexture(GL_TEXTURE0 + i);
    glBindTexture(GL_TEXTURE_2D, name_of(units_[i].texture));
    glBindSampler(i, name_of(units_[i].sampler));
  }
  glActiveTexture(enum_of(active_texture_));
  for (size_t i = 0; i < kUnpackSettings.size(); ++i) glPixelStorei(kUnpackSettings[i], unpack_[i]);
  for (size_t i = 0; i < kToggles.size(); ++i) set_enabled(kToggles[i], toggles_[i] == GL_TRUE);
  glViewport(viewport_[0], viewport_[1], viewport_[2], viewport_[3]);
  glScissor(scissor_[0], scissor_[1], scissor_[2], scissor_[3]);
  glColorMask(color_mask_[0], color_mask_[1], color_mask_[2], color_mask_[3]);
  glClearColor(clear_color_[0], clear_color_[1], clear_color_[2], clear_color_[3]);
  glDepthMask(depth_mask_);
  glClearDepthf(clear_depth_);
  glDepthRangef(depth_range_[0], depth_range_[1]);
  glDepthFunc(enum_of(depth_function_));
  glCullFace(enum_of(cull_face_));
  glFrontFace(enum_of(front_face_));
  if (clip_control_ != nullptr) clip_control_(enum_of(clip_origin_), enum_of(clip_depth_));
}

}  // namespace tessera::client::gles
