#include "client-sdk/gles/table_texture.h"

#include <algorithm>
#include <cstring>

namespace tessera::client::gles {

Status TableTexture::update(std::span<const std::byte> texels) {
  const size_t row_bytes = kWidth * format_.bytes;
  const size_t rows = (texels.size() + row_bytes - 1) / row_bytes;
  const bool grown = rows * row_bytes > content_.size() || texture_.id() == 0;
  if (grown) TESSERA_RETURN_IF_ERROR(grow(std::max<size_t>(rows, 1)));

  size_t first_changed = 0;  // of the run of changed rows before `row`
  for (size_t row = 0; row <= rows; ++row) {
    bool changed = false;
    if (row < rows) {
      const auto source =
          texels.subspan(row * row_bytes, std::min(row_bytes, texels.size() - row * row_bytes));
      std::byte* held = content_.data() + row * row_bytes;
      changed = grown || std::memcmp(held, source.data(), source.size()) != 0;
      if (changed) std::memcpy(held, source.data(), source.size());
    }
    if (changed) continue;
    if (first_changed < row) upload(first_changed, row);
    first_changed = row + 1;
  }
  return check_errors("upload of a table to the display device");
}

Status TableTexture::grow(size_t rows) {
  GLint max_rows = 0;
  glGetIntegerv(GL_MAX_TEXTURE_SIZE, &max_rows);
  if (rows > static_cast<size_t>(max_rows)) {
    return absl::ResourceExhaustedError(absl::StrCat("a table of ", rows * kWidth,
                                                     " entries exceeds the device's limit of ",
                                                     static_cast<size_t>(max_rows) * kWidth));
  }
  const size_t held_rows = content_.size() / (kWidth * format_.bytes);
  const size_t new_rows = std::min(std::max(rows, 2 * held_rows), static_cast<size_t>(max_rows));
  content_.clear();  // until there is a texture that holds it, so that a failure is not forgotten
  texture_ = make_texture();
  set_sampling(texture_, GL_NEAREST);
  glTexImage2D(GL_TEXTURE_2D, 0, format_.internal_format, kWidth, static_cast<GLsizei>(new_rows), 0,
               format_.format, format_.type, nullptr);
  TESSERA_RETURN_IF_ERROR(check_errors("glTexImage2D of a table"));
  content_.assign(new_rows * kWidth * format_.bytes, std::byte{0});
  return absl::OkStatus();
}

void TableTexture::upload(size_t first_row, size_t end_row) {
  glBindTexture(GL_TEXTURE_2D, texture_.id());
  glPixelStorei(GL_UNPACK_ALIGNMENT, 4);
  glPixelStorei(GL_UNPACK_ROW_LENGTH, 0);
  glTexSubImage2D(GL_TEXTURE_2D, 0, 0, static_cast<GLint>(first_row), kWidth,
                  static_cast<GLsizei>(end_row - first_row), format_.format, format_.type,
                  content_.data() + first_row * kWidth * format_.bytes);
}

}  // namespace tessera::client::gles
