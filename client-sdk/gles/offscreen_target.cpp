#include "client-sdk/gles/offscreen_target.h"

#include <algorithm>

namespace tessera::client::gles {
namespace {

Status check_complete(const char* what) {
  const GLenum status = glCheckFramebufferStatus(GL_FRAMEBUFFER);
  if (status == GL_FRAMEBUFFER_COMPLETE) return absl::OkStatus();
  return absl::UnavailableError(absl::StrFormat("%s is incomplete (0x%04x)", what, status));
}

Status check_limits(uint32_t width, uint32_t height, uint32_t samples) {
  GLint max_side = 0;
  glGetIntegerv(GL_MAX_RENDERBUFFER_SIZE, &max_side);
  const uint32_t max_samples = OffscreenTarget::max_samples();
  if (width == 0 || height == 0 || std::max(width, height) > static_cast<uint32_t>(max_side)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "a picture of ", width, "x", height, " pixels is not possible here (1 to ", max_side, " a side)"));
  }
  if (samples == 0 || samples > max_samples) {
    return absl::InvalidArgumentError(
        absl::StrCat(samples, " samples per pixel are not possible here (1 to ", max_samples, ")"));
  }
  return absl::OkStatus();
}

Renderbuffer make_storage(GLenum format, uint32_t width, uint32_t height, uint32_t samples) {
  Renderbuffer buffer = make_renderbuffer();
  glBindRenderbuffer(GL_RENDERBUFFER, buffer.id());
  glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples > 1 ? static_cast<GLsizei>(samples) : 0, format,
                                   static_cast<GLsizei>(width), static_cast<GLsizei>(height));
  return buffer;
}

}  // namespace

// GL_MAX_SAMPLES holds for colour; float depth may offer less.
uint32_t OffscreenTarget::max_samples() {
  GLint color = 0, depth = 0;
  glGetInternalformativ(GL_RENDERBUFFER, GL_RGBA8, GL_SAMPLES, 1, &color);
  glGetInternalformativ(GL_RENDERBUFFER, GL_DEPTH_COMPONENT32F, GL_SAMPLES, 1, &depth);
  return static_cast<uint32_t>(std::max(1, std::min(color, depth)));
}

StatusOr<OffscreenTarget> OffscreenTarget::create(uint32_t width, uint32_t height, uint32_t samples) {
  TESSERA_RETURN_IF_ERROR(check_limits(width, height, samples));
  OffscreenTarget target;
  target.width_ = width;
  target.height_ = height;
  target.color_ = make_storage(GL_RGBA8, width, height, samples);
  target.depth_ = make_storage(GL_DEPTH_COMPONENT32F, width, height, samples);
  target.picture_ = make_texture();
  set_sampling(target.picture_, GL_LINEAR);
  glTexStorage2D(GL_TEXTURE_2D, 1, GL_RGBA8, static_cast<GLsizei>(width), static_cast<GLsizei>(height));

  target.framebuffer_ = make_framebuffer();
  glBindFramebuffer(GL_FRAMEBUFFER, target.framebuffer_.id());
  glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, target.color_.id());
  glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, target.depth_.id());
  TESSERA_RETURN_IF_ERROR(check_complete("the display's framebuffer"));

  target.resolved_ = make_framebuffer();
  glBindFramebuffer(GL_FRAMEBUFFER, target.resolved_.id());
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, target.picture_.id(), 0);
  TESSERA_RETURN_IF_ERROR(check_complete("the display's resolved framebuffer"));
  TESSERA_RETURN_IF_ERROR(check_errors("creation of the display's framebuffer"));
  return target;
}

void OffscreenTarget::resolve() {
  const GLint width = static_cast<GLint>(width_), height = static_cast<GLint>(height_);
  glBindFramebuffer(GL_READ_FRAMEBUFFER, framebuffer_.id());
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, resolved_.id());
  glBlitFramebuffer(0, 0, width, height, 0, 0, width, height, GL_COLOR_BUFFER_BIT, GL_NEAREST);
}

StatusOr<Image8> OffscreenTarget::read_back() {
  resolve();
  glBindFramebuffer(GL_READ_FRAMEBUFFER, resolved_.id());
  const size_t row_bytes = size_t{4} * width_;
  bottom_up_.resize(row_bytes * height_);
  glPixelStorei(GL_PACK_ALIGNMENT, 4);
  glReadPixels(0, 0, static_cast<GLsizei>(width_), static_cast<GLsizei>(height_), GL_RGBA, GL_UNSIGNED_BYTE,
               bottom_up_.data());
  TESSERA_RETURN_IF_ERROR(check_errors("readback of the picture"));

  Image8 image(width_, height_);
  for (uint32_t row = 0; row < height_; ++row) {
    std::copy_n(bottom_up_.data() + (height_ - 1 - row) * row_bytes, row_bytes, image.at(0, row));
  }
  return image;
}

}  // namespace tessera::client::gles
