// OpenGL ES objects that delete themselves, and errors as statuses. A context must be current wherever these
// are used.
#pragma once

#include <GLES3/gl3.h>
// After it:
#include <GLES2/gl2ext.h>

#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>

#include "base/status.h"

namespace tessera::client::gles {

// Owns one GL name.
template <void (*Delete)(GLuint)>
class Handle {
 public:
  Handle() = default;
  explicit Handle(GLuint id) : id_(id) {}
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, 0)) {}
  Handle& operator=(Handle&& other) noexcept {
    std::swap(id_, other.id_);
    return *this;
  }
  ~Handle() {
    if (id_ != 0) Delete(id_);
  }
  GLuint id() const { return id_; }

 private:
  GLuint id_ = 0;
};

inline void delete_texture(GLuint id) {
  glDeleteTextures(1, &id);
}
inline void delete_renderbuffer(GLuint id) {
  glDeleteRenderbuffers(1, &id);
}
inline void delete_framebuffer(GLuint id) {
  glDeleteFramebuffers(1, &id);
}
inline void delete_vertex_array(GLuint id) {
  glDeleteVertexArrays(1, &id);
}
inline void delete_shader(GLuint id) {
  glDeleteShader(id);
}
inline void delete_program(GLuint id) {
  glDeleteProgram(id);
}

using Texture = Handle<delete_texture>;
using Renderbuffer = Handle<delete_renderbuffer>;
using Framebuffer = Handle<delete_framebuffer>;
using VertexArray = Handle<delete_vertex_array>;
using Shader = Handle<delete_shader>;
using Program = Handle<delete_program>;

Texture make_texture();
Renderbuffer make_renderbuffer();
Framebuffer make_framebuffer();
VertexArray make_vertex_array();
// Sources may come in parts.
StatusOr<Program> make_program(std::initializer_list<const char*> vertex_source,
                               std::initializer_list<const char*> fragment_source);

// Filter GL_NEAREST or GL_LINEAR, no mip levels, clamped to the edge; the texture stays bound to
// GL_TEXTURE_2D.
void set_sampling(const Texture& texture, GLint filter);
void bind_texture(GLuint unit, const Texture& texture);
void set_sampler(const Program& program, const char* name, GLint unit);

bool has_extension(std::string_view name);
// EXT_clip_control's entry, which lets depth run from 0 to 1; null where the driver does not have it.
using ClipControl = PFNGLCLIPCONTROLEXTPROC;
ClipControl find_clip_control();

// The first error since the last call, if any; `what` names the step that failed.
Status check_errors(const char* what);

}  // namespace tessera::client::gles
