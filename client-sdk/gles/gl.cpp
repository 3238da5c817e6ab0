#include "client-sdk/gles/gl.h"

#include <EGL/egl.h>

namespace tessera::client::gles {
namespace {

template <typename HandleType, void (*Generate)(GLsizei, GLuint*)>
HandleType generate() {
  GLuint id = 0;
  Generate(1, &id);
  return HandleType(id);
}

StatusOr<Shader> compile(GLenum stage, std::initializer_list<const char*> source) {
  Shader shader(glCreateShader(stage));
  glShaderSource(shader.id(), static_cast<GLsizei>(source.size()), source.begin(), nullptr);
  glCompileShader(shader.id());
  GLint ok = GL_FALSE;
  glGetShaderiv(shader.id(), GL_COMPILE_STATUS, &ok);
  if (ok == GL_TRUE) return shader;
  char log[2048] = {};
  glGetShaderInfoLog(shader.id(), sizeof(log) - 1, nullptr, log);
  return absl::InternalError(absl::StrCat(
      "glCompileShader of a ", stage == GL_VERTEX_SHADER ? "vertex" : "fragment", " shader failed: ", log));
}

}  // namespace

Texture make_texture() {
  return generate<Texture, glGenTextures>();
}
Renderbuffer make_renderbuffer() {
  return generate<Renderbuffer, glGenRenderbuffers>();
}
Framebuffer make_framebuffer() {
  return generate<Framebuffer, glGenFramebuffers>();
}
VertexArray make_vertex_array() {
  return generate<VertexArray, glGenVertexArrays>();
}

StatusOr<Program> make_program(std::initializer_list<const char*> vertex_source,
                               std::initializer_list<const char*> fragment_source) {
  TESSERA_ASSIGN_OR_RETURN(const Shader vertex, compile(GL_VERTEX_SHADER, vertex_source));
  TESSERA_ASSIGN_OR_RETURN(const Shader fragment, compile(GL_FRAGMENT_SHADER, fragment_source));
  Program program(glCreateProgram());
  glAttachShader(program.id(), vertex.id());
  glAttachShader(program.id(), fragment.id());
  glLinkProgram(program.id());
  GLint ok = GL_FALSE;
  glGetProgramiv(program.id(), GL_LINK_STATUS, &ok);
  if (ok == GL_TRUE) return program;
  char log[2048] = {};
  glGetProgramInfoLog(program.id(), sizeof(log) - 1, nullptr, log);
  return absl::InternalError(absl::StrCat("glLinkProgram failed: ", log));
}

void set_sampling(const Texture& texture, GLint filter) {
  glBindTexture(GL_TEXTURE_2D, texture.id());
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, filter);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, filter);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
}

void bind_texture(GLuint unit, const Texture& texture) {
  glActiveTexture(GL_TEXTURE0 + unit);
  glBindTexture(GL_TEXTURE_2D, texture.id());
}

void set_sampler(const Program& program, const char* name, GLint unit) {
  glUseProgram(program.id());
  glUniform1i(glGetUniformLocation(program.id(), name), unit);
}

bool has_extension(std::string_view name) {
  GLint count = 0;
  glGetIntegerv(GL_NUM_EXTENSIONS, &count);
  for (GLint i = 0; i < count; ++i) {
    const GLubyte* extension = glGetStringi(GL_EXTENSIONS, static_cast<GLuint>(i));
    if (extension != nullptr && name == reinterpret_cast<const char*>(extension)) return true;
  }
  return false;
}

ClipControl find_clip_control() {
  if (!has_extension("GL_EXT_clip_control")) return nullptr;
  return reinterpret_cast<ClipControl>(eglGetProcAddress("glClipControlEXT"));
}

Status check_errors(const char* what) {
  const GLenum error = glGetError();
  if (error == GL_NO_ERROR) return absl::OkStatus();
  while (glGetError() != GL_NO_ERROR) {
  }
  if (error == GL_OUT_OF_MEMORY)
    return absl::ResourceExhaustedError(absl::StrCat(what, ": out of device memory"));
  return absl::InternalError(absl::StrFormat("%s: OpenGL ES error 0x%04x", what, error));
}

}  // namespace tessera::client::gles
