#include "client-sdk/gles/atlas_texture.h"

#include "client-sdk/gles/shared_shaders.h"

namespace tessera::client::gles {
namespace {

// Reads: the three planes. Writes: RGB of the same texel. texelFetch, so that chroma never crosses a block's
// border.
constexpr const char* kConvertFragment = R"(#version 300 es
precision highp float;
uniform highp sampler2D plane_y;
uniform highp sampler2D plane_u;
uniform highp sampler2D plane_v;
out vec4 rgba;
void main() {
  ivec2 texel = ivec2(gl_FragCoord.xy);
  float luma = (255.0 * texelFetch(plane_y, texel, 0).r - 16.0) / 219.0;
  float blue = (255.0 * texelFetch(plane_u, texel / 2, 0).r - 128.0) / 224.0;
  float red = (255.0 * texelFetch(plane_v, texel / 2, 0).r - 128.0) / 224.0;
  // ITU-R BT.709: Kr = 0.2126, Kb = 0.0722.
  rgba = vec4(luma + 1.5748 * red, luma - 0.187324 * blue - 0.468124 * red, luma + 1.8556 * blue, 1.0);
}
)";

void upload_plane(const Texture& texture, const uint8_t* data, uint32_t stride, uint32_t width,
                  uint32_t height) {
  glBindTexture(GL_TEXTURE_2D, texture.id());
  glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  glPixelStorei(GL_UNPACK_ROW_LENGTH, static_cast<GLint>(stride));
  glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, static_cast<GLsizei>(width), static_cast<GLsizei>(height), GL_RED,
                  GL_UNSIGNED_BYTE, data);
  glPixelStorei(GL_UNPACK_ROW_LENGTH, 0);
}

}  // namespace

StatusOr<AtlasTexture> AtlasTexture::create() {
  AtlasTexture atlas;
  TESSERA_ASSIGN_OR_RETURN(atlas.convert_, make_program({kFullScreenVertex}, {kConvertFragment}));
  set_sampler(atlas.convert_, "plane_y", 0);
  set_sampler(atlas.convert_, "plane_u", 1);
  set_sampler(atlas.convert_, "plane_v", 2);
  atlas.no_attributes_ = make_vertex_array();
  atlas.framebuffer_ = make_framebuffer();
  TESSERA_RETURN_IF_ERROR(check_errors("creation of the atlas texture"));
  return atlas;
}

Status AtlasTexture::resize(uint32_t width, uint32_t height) {
  if (width == width_ && height == height_) return absl::OkStatus();
  GLint limit = 0;
  glGetIntegerv(GL_MAX_TEXTURE_SIZE, &limit);
  if (width == 0 || height == 0 || width > static_cast<uint32_t>(limit) ||
      height > static_cast<uint32_t>(limit)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "an atlas of ", width, "x", height, " does not fit the display device (1 to ", limit, " a side)"));
  }
  width_ = height_ = 0;  // until there is one, so that a failure is not forgotten
  rgba_ = make_texture();
  set_sampling(rgba_, GL_LINEAR);
  glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, static_cast<GLsizei>(width), static_cast<GLsizei>(height), 0,
               GL_RGBA, GL_UNSIGNED_BYTE, nullptr);
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.id());
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, rgba_.id(), 0);
  TESSERA_RETURN_IF_ERROR(check_errors("allocation of the atlas texture"));
  width_ = width;
  height_ = height;
  return absl::OkStatus();
}

Status AtlasTexture::resize_planes() {
  if (plane_width_ == width_ && plane_height_ == height_) return absl::OkStatus();
  plane_width_ = plane_height_ = 0;
  for (int i = 0; i < 3; ++i) {
    planes_[i] = make_texture();
    set_sampling(planes_[i], GL_NEAREST);
    const GLsizei divisor = i == 0 ? 1 : 2;
    glTexImage2D(GL_TEXTURE_2D, 0, GL_R8, static_cast<GLsizei>(width_) / divisor,
                 static_cast<GLsizei>(height_) / divisor, 0, GL_RED, GL_UNSIGNED_BYTE, nullptr);
  }
  TESSERA_RETURN_IF_ERROR(check_errors("allocation of the atlas's planes"));
  plane_width_ = width_;
  plane_height_ = height_;
  return absl::OkStatus();
}

Status AtlasTexture::set(const YuvView& atlas) {
  if (atlas.width % 2 != 0 || atlas.height % 2 != 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("a 4:2:0 atlas must have even sides, not ", atlas.width, "x", atlas.height));
  }
  TESSERA_RETURN_IF_ERROR(resize(atlas.width, atlas.height));
  glActiveTexture(GL_TEXTURE0);
  TESSERA_RETURN_IF_ERROR(resize_planes());
  upload_plane(planes_[0], atlas.y, atlas.y_stride, atlas.width, atlas.height);
  upload_plane(planes_[1], atlas.u, atlas.uv_stride, atlas.width / 2, atlas.height / 2);
  upload_plane(planes_[2], atlas.v, atlas.uv_stride, atlas.width / 2, atlas.height / 2);

  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.id());
  glViewport(0, 0, static_cast<GLsizei>(width_), static_cast<GLsizei>(height_));
  glDisable(GL_DEPTH_TEST);
  glDisable(GL_CULL_FACE);
  glDisable(GL_SAMPLE_ALPHA_TO_COVERAGE);
  glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
  glUseProgram(convert_.id());
  for (GLuint i = 0; i < 3; ++i) bind_texture(i, planes_[i]);
  glBindVertexArray(no_attributes_.id());
  glDrawArrays(GL_TRIANGLES, 0, 3);
  return check_errors("conversion of the atlas to RGB");
}

Status AtlasTexture::set(const Image8& atlas) {
  TESSERA_RETURN_IF_ERROR(resize(atlas.width, atlas.height));
  glActiveTexture(GL_TEXTURE0);
  glBindTexture(GL_TEXTURE_2D, rgba_.id());
  glPixelStorei(GL_UNPACK_ALIGNMENT, 4);
  glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, static_cast<GLsizei>(width_), static_cast<GLsizei>(height_),
                  GL_RGBA, GL_UNSIGNED_BYTE, atlas.rgba.data());
  return check_errors("upload of the atlas");
}

}  // namespace tessera::client::gles
