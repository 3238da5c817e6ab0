// An app's side of the context: framebuffers of all kinds, and the pictures in them.
#pragma once

#include <gtest/gtest.h>

#include <memory>

#include "client-sdk/gles/egl_context.h"
#include "client-sdk/gles/gl.h"
#include "display_fixture.h"

namespace tessera::client::test {

struct FramebufferKind {
  GLenum color = GL_RGBA8, depth = GL_DEPTH_COMPONENT24;  // GL_NONE: without
  GLsizei samples = 0;
};

class AppFramebuffer {
 public:
  AppFramebuffer(uint32_t width, uint32_t height, const FramebufferKind& kind = {})
      : width_(width), height_(height) {
    framebuffer_ = gles::make_framebuffer();
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.id());
    if (kind.color != GL_NONE) color_ = attach(GL_COLOR_ATTACHMENT0, kind.color, kind.samples);
    if (kind.depth != GL_NONE) depth_ = attach(GL_DEPTH_ATTACHMENT, kind.depth, kind.samples);
    EXPECT_EQ(glCheckFramebufferStatus(GL_FRAMEBUFFER), GLenum{GL_FRAMEBUFFER_COMPLETE});
  }
  GLuint id() const { return framebuffer_.id(); }

  // What it holds, row 0 = top. Values are encoded even if the framebuffer is sRGB.
  Image8 picture() const {
    gles::Renderbuffer resolved_color = make_buffer(GL_RGBA8, 0);
    gles::Framebuffer resolved = gles::make_framebuffer();
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, resolved.id());
    glFramebufferRenderbuffer(GL_DRAW_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER,
                              resolved_color.id());
    glBindFramebuffer(GL_READ_FRAMEBUFFER, framebuffer_.id());
    GLint samples = 0;
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, framebuffer_.id());
    glGetIntegerv(GL_SAMPLES, &samples);
    if (samples > 1) {
      glBindFramebuffer(GL_DRAW_FRAMEBUFFER, resolved.id());
      glBlitFramebuffer(0, 0, width_, height_, 0, 0, width_, height_, GL_COLOR_BUFFER_BIT, GL_NEAREST);
      glBindFramebuffer(GL_READ_FRAMEBUFFER, resolved.id());
    }
    Image8 upside_down(width_, height_), image(width_, height_);
    glReadPixels(0, 0, width_, height_, GL_RGBA, GL_UNSIGNED_BYTE, upside_down.rgba.data());
    EXPECT_TRUE(gles::check_errors("reading the app's framebuffer").ok());
    for (uint32_t y = 0; y < height_; ++y)
      std::copy_n(upside_down.at(0, height_ - 1 - y), 4 * width_, image.at(0, y));
    return image;
  }

 private:
  gles::Renderbuffer make_buffer(GLenum format, GLsizei samples) const {
    gles::Renderbuffer buffer = gles::make_renderbuffer();
    glBindRenderbuffer(GL_RENDERBUFFER, buffer.id());
    glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples, format, width_, height_);
    return buffer;
  }
  gles::Renderbuffer attach(GLenum where, GLenum format, GLsizei samples) const {
    gles::Renderbuffer buffer = make_buffer(format, samples);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, where, GL_RENDERBUFFER, buffer.id());
    return buffer;
  }

  uint32_t width_, height_;
  gles::Renderbuffer color_, depth_;
  gles::Framebuffer framebuffer_;
};

inline std::unique_ptr<gles::EglContext> make_app_context() {
  auto context = gles::EglContext::create();
  if (!context.ok()) {
    ADD_FAILURE() << context.status();
    std::abort();
  }
  return *std::move(context);
}

// The largest difference of any channel.
inline int largest_difference(const Image8& a, const Image8& b) {
  if (a.rgba.size() != b.rgba.size()) return 256;
  int largest = 0;
  for (size_t i = 0; i < a.rgba.size(); ++i) largest = std::max(largest, std::abs(a.rgba[i] - b.rgba[i]));
  return largest;
}

inline Image8 cut(const Image8& image, uint32_t x0, uint32_t y0, uint32_t width, uint32_t height) {
  Image8 part(width, height);
  for (uint32_t y = 0; y < height; ++y) std::copy_n(image.at(x0, y0 + y), 4 * width, part.at(0, y));
  return part;
}

}  // namespace tessera::client::test
