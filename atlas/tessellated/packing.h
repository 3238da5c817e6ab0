// Places for the shapes of a frame, from an empty atlas: bins by height in rows, the highest first (TSS
// section 4, "Atlas mapping"). A bin goes on in the row in which the one before it ended.
#pragma once

#include <cstdint>
#include <optional>

#include "atlas/placement.h"
#include "base/math.h"

namespace tessera::atlas::tessellated {

// How far behind a staircase that lies on its long side the next one of the same width may begin, if it is
// turned by 180 degrees: nested as tightly as the lengths of their columns allow.
int nesting_offset(ivec2 size, ivec2 turned_size);

// Of the rectangle around a staircase on its long side; even.
int half_row_height(ivec2 size);

// Left to right from even texels, then row by row downwards; no item is higher than the one before it.
class Rows {
 public:
  Rows(uint32_t width, uint32_t height) : width_(width), height_(height) {}
  // Upper left corner of a rectangle with an even height, or nothing: then nothing has changed.
  std::optional<uvec2> place(uint32_t width, uint32_t height);
  // Is there room for so much from this x on in the row of the last item? If so, what follows begins after
  // it.
  bool extend(uint32_t x, uint32_t width);

 private:
  uint32_t width_, height_;
  uint32_t x_ = 0, y_ = 0, row_height_ = 0;
};

// The Ls of one level.
class LBin {
 public:
  LBin(Rows& rows, uint32_t level) : rows_(rows), level_(static_cast<uint8_t>(level)) {}
  // Sets x, y and l.turned and l.next_y of `placement`, whose l.level and l.splits are set; false, and
  // nothing has changed, if there is no room. Masked ones must come first: they leave no half pairs.
  bool place(Placement& placement);

 private:
  Rows& rows_;
  uint8_t level_;
  std::optional<uvec2> open_;  // a pair of which the turned L is free
};

// The halves of one width.
class HalfBin {
 public:
  explicit HalfBin(Rows& rows) : rows_(rows) {}
  // Sets all of `half` but its length; false if there is no room.
  bool place(ivec2 size, HalfPlace& half);

 private:
  Rows& rows_;
  struct Open {
    uvec2 at;
    ivec2 size;
  };
  std::optional<Open> open_;  // the last item, if it is not turned
};

}  // namespace tessera::atlas::tessellated
