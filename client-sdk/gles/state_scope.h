// Leaves the context as it was found: an app's own drawing goes on after ours.
#pragma once

#include <array>

#include "client-sdk/gles/gl.h"

namespace tessera::client::gles {

// While it lives, the state that our passes neither set nor want otherwise is neutral: nothing is blended,
// masked, scissored, offset or converted on its way. At its end everything that our passes change is as
// before. Transform feedback must not be active.
class StateScope {
 public:
  static constexpr GLuint kTextureUnits = 4;  // that our passes use

  // `clip_control` may be null.
  explicit StateScope(ClipControl clip_control);
  ~StateScope();
  StateScope(const StateScope&) = delete;
  StateScope& operator=(const StateScope&) = delete;

 private:
  struct Unit {
    GLint texture = 0, sampler = 0;
  };

  void save();
  static void neutralise();

  static constexpr std::array<GLenum, 10> kToggles{GL_BLEND,
                                                   GL_CULL_FACE,
                                                   GL_DEPTH_TEST,
                                                   GL_DITHER,
                                                   GL_SCISSOR_TEST,
                                                   GL_STENCIL_TEST,
                                                   GL_SAMPLE_COVERAGE,
                                                   GL_SAMPLE_ALPHA_TO_COVERAGE,
                                                   GL_POLYGON_OFFSET_FILL,
                                                   GL_RASTERIZER_DISCARD};
  static constexpr std::array<GLenum, 4> kUnpackSettings{GL_UNPACK_ALIGNMENT, GL_UNPACK_ROW_LENGTH,
                                                         GL_UNPACK_SKIP_ROWS, GL_UNPACK_SKIP_PIXELS};

  ClipControl clip_control_;
  GLint draw_framebuffer_ = 0, read_framebuffer_ = 0, renderbuffer_ = 0;
  GLint program_ = 0, vertex_array_ = 0, unpack_buffer_ = 0, active_texture_ = 0;
  std::array<Unit, kTextureUnits> units_;
  std::array<GLint, kUnpackSettings.size()> unpack_{};
  std::array<GLboolean, kToggles.size()> toggles_{};
  std::array<GLint, 4> viewport_{}, scissor_{};
  std::array<GLboolean, 4> color_mask_{};
  std::array<GLfloat, 4> clear_color_{};
  GLboolean depth_mask_ = GL_TRUE;
  GLfloat clear_depth_ = 1;
  std::array<GLfloat, 2> depth_range_{};
  GLint depth_function_ = 0, cull_face_ = 0, front_face_ = 0;
  GLint clip_origin_ = 0, clip_depth_ = 0;
};

}  // namespace tessera::client::gles
