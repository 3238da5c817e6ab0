#include "atlas/tessellated/packing.h"

#include <algorithm>

#include "atlas/addressing/addressing.h"

namespace tessera::atlas::tessellated {
namespace {

uint32_t even(uint32_t texels) {
  return (texels + 1) / 2 * 2;
}

}  // namespace

// The first one's column c has r(c) texels at the top, the turned one's the same at the bottom of its own:
// where both are, they must leave each other room. Columns of one stretch are equally high, so that its last
// one decides.
int nesting_offset(ivec2 size, ivec2 turned_size) {
  const int stretch = addressing::staircase_stretch(size);
  const int turned_stretch = addressing::staircase_stretch(turned_size);
  int offset = 0;
  for (int column = 0; column < size.y + stretch; column += stretch) {
    const int last = std::min(column, size.y);
    const int nested = last - turned_size.y + 1 + turned_stretch * addressing::staircase_row(last, size);
    offset = std::max(offset, std::min(last + 1, nested));
  }
  return offset;
}

int half_row_height(ivec2 size) {
  return (size.x + 2) / 2 * 2;
}

std::optional<uvec2> Rows::place(uint32_t width, uint32_t height) {
  if (width > width_) return std::nullopt;
  const bool next_row = row_height_ == 0 || x_ + width > width_;
  const uint32_t y = next_row ? y_ + row_height_ : y_;
  if (y + height > height_) return std::nullopt;
  if (next_row) {
    y_ = y;
    x_ = 0;
    row_height_ = height;
  }
  const uvec2 at(x_, y_);
  x_ = even(x_ + width);
  return at;
}

bool Rows::extend(uint32_t x, uint32_t width) {
  if (x + width > width_) return false;
  x_ = std::max(x_, even(x + width));
  return true;
}

bool LBin::place(Placement& placement) {
  LPlace& l = placement.l;
  const Rows before = rows_;
  const glm::uvec2 pitch(addressing::l_pair_pitch(level_));
  const uint32_t ls = uint32_t{l.splits} * l.splits;
  const bool in_open = open_ && !placement.masked;
  const uint32_t begin = in_open ? 1 : 0, end = begin + (placement.masked ? 2 * ls : ls);  // in half pairs
  std::optional<uvec2> first, last;
  if (in_open) first = open_;
  uint32_t next_y = 0;
  for (uint32_t half = 2 * begin; half < end; half += 2) {
    last = rows_.place(pitch.x, pitch.y);
    if (!last) {
      rows_ = before;
      return false;
    }
    if (!first) first = last;
    if (next_y == 0 && last->y != first->y) next_y = last->y;
  }
  placement.x = static_cast<uint16_t>(first->x);
  placement.y = static_cast<uint16_t>(first->y);
  l.turned = in_open;
  l.next_y = static_cast<uint16_t>(next_y);
  // The last of its pairs has a free L if it holds only one.
  open_ = end % 2 == 0 ? std::nullopt : last;
  return true;
}

bool HalfBin::place(ivec2 size, HalfPlace& half) {
  if (open_) {
    const uint32_t x = open_->at.x + static_cast<uint32_t>(nesting_offset(open_->size, size));
    if (rows_.extend(x, static_cast<uint32_t>(size.y) + 1)) {
      half.x = static_cast<uint16_t>(x);
      half.y = static_cast<uint16_t>(open_->at.y);
      half.turned = true;
      open_.reset();
      return true;
    }
  }
  const auto at =
      rows_.place(static_cast<uint32_t>(size.y) + 1, static_cast<uint32_t>(half_row_height(size)));
  if (!at) return false;
  half.x = static_cast<uint16_t>(at->x);
  half.y = static_cast<uint16_t>(at->y);
  half.turned = false;
  open_ = Open{*at, size};
  return true;
}

}  // namespace tessera::atlas::tessellated
