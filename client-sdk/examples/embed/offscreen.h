// Stands in for what an app has anyway: an OpenGL ES context, and a framebuffer with depth, bound.
#pragma once

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GLES3/gl3.h>

#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

class Offscreen {
 public:
  Offscreen(int width, int height) : width_(width), height_(height) {
    const EGLDisplay display = eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, nullptr, nullptr);
    const EGLint version[] = {EGL_CONTEXT_MAJOR_VERSION, 3, EGL_NONE};
    eglInitialize(display, nullptr, nullptr);
    eglBindAPI(EGL_OPENGL_ES_API);
    const EGLContext context = eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, version);
    if (!eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context))
      throw std::runtime_error("no OpenGL ES 3 context without a window");
    GLuint framebuffer = 0;
    glGenFramebuffers(1, &framebuffer);
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
    attach(GL_COLOR_ATTACHMENT0, GL_RGBA8);
    attach(GL_DEPTH_ATTACHMENT, GL_DEPTH_COMPONENT24);
  }

  void write_ppm(const std::string& file) const {
    std::vector<char> rgba(4 * width_ * height_);
    glReadPixels(0, 0, width_, height_, GL_RGBA, GL_UNSIGNED_BYTE, rgba.data());  // the lowest row first
    std::ofstream out(file, std::ios::binary);
    out << "P6 " << width_ << " " << height_ << " 255\n";
    for (int y = height_ - 1; y >= 0; --y)
      for (int x = 0; x < width_; ++x) out.write(&rgba[4 * (y * width_ + x)], 3);
    if (!out.flush()) throw std::runtime_error("cannot write " + file);
  }

 private:
  void attach(GLenum where, GLenum format) const {
    GLuint buffer = 0;
    glGenRenderbuffers(1, &buffer);
    glBindRenderbuffer(GL_RENDERBUFFER, buffer);
    glRenderbufferStorage(GL_RENDERBUFFER, format, width_, height_);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, where, GL_RENDERBUFFER, buffer);
  }

  int width_, height_;
};
