// Memory of layout `coherent`. The atlas is cut into shelves, aligned groups of shelves into slabs side by
// side, a slab into rectangles one below another:
//
//   shelf   across the atlas, kShelfHeight texels high (the last may be lower)
//   slab    as wide as its rectangles (or wider), 1, 2, 4 or 8 shelves high (fewer at the atlas' end); drawn
//           when its width runs out of room
//   rect    of the slab's width and any even height
//
// So widths, and heights within a slab, are packed as intervals of a line, where free neighbours merge by
// themselves: freed room serves every height that fits its slab, an empty slab every width.
//
// One slab of each width is half empty in the mean, so none should be a large part of the atlas: the wider,
// the lower, and in a small atlas all are. The price: free shelves make a higher slab in aligned groups only.
//
// JPEG and H.264 transform squares of 8 texels, and one that two rectangles share costs bits. So slabs whose
// widths are whole squares stand on squares, from the left, and rectangles of such heights from the top; the
// others stand on halves or quarters of squares, from the other end.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/math.h"

namespace tessera::atlas::coherent {

constexpr uint32_t kShelfHeight = 32;                           // texels
constexpr uint32_t kMostShelves = 8;                            // of a slab; a power of two
constexpr uint32_t kLongestSide = kMostShelves * kShelfHeight;  // of a rectangle
constexpr uint32_t kSquare = 8;                                 // texels
constexpr uint32_t kUnit = 2;                                   // texels: all sides and places are multiples

struct SlabStats {
  uint64_t used_texels = 0;      // in rectangles
  uint64_t slab_texels = 0;      // in slabs
  uint64_t capacity_texels = 0;  // of the atlas
};

// Equal calls give equal results. Not thread-safe.
class Slabs {
 public:
  // Sides of the atlas: even, at most 8192.
  Slabs(uint32_t width, uint32_t height);

  // Upper left texel of a free rectangle, or nothing if there is no room. Sides: even, 2..kLongestSide. In
  // the first slab of its width that has room; if it may draw, else in a new slab, or in the narrowest wider
  // one that has room, up to four times as wide.
  std::optional<uvec2> allocate(uint32_t width, uint32_t height, bool may_draw = true);
  // Gives back what allocate() returned for these sides.
  void free(uvec2 at, uint32_t width, uint32_t height);

  // Closes the emptiest slabs to allocate(), together holding at most `budget_texels` in rectangles: once
  // these are freed and placed elsewhere, the slabs return to the shelves. Slabs above `fullest` (share in
  // use) stay open, and those whose rectangles are higher in sum than the gaps in the others of their width.
  // Returns whether any was closed.
  bool close_emptiest(uint64_t budget_texels, float fullest);
  // Closes the slabs that stand where a new one of the best height for this rectangle is the cheapest to
  // clear, if these hold at most `budget_texels`. Returns whether any was closed: none if it has room
  // already. For when allocate() found none.
  bool close_for(uint32_t width, uint32_t height, uint64_t budget_texels);
  bool closed(uvec2 at) const { return slab_at(at).closed; }
  void reopen();

  SlabStats stats() const;
  // Free room in the shelves, as a share of them. It may lie in pieces too low for a slab of 8 shelves.
  float free_share() const;

 private:
  using Rows = unsigned __int128;  // a bit for each unit of a slab's height; 1 = free

  struct Slab {
    uint16_t x = 0, width = 0, height = 0;  // in units
    uint16_t shelf = 0, shelves = 0;        // the first, and how many
    uint16_t used = 0;                      // units of height
    bool closed = false;
    Rows free_rows = 0;
  };
  struct Shelf {
    uint32_t units = 0;               // of height
    uint32_t free_units = 0;          // of width
    std::vector<uint8_t> taken;       // a unit of width
    std::vector<uint32_t> slab_of_x;  // where one is taken
  };

  const Slab& slab_at(uvec2 at) const { return slabs_[index_at(at)]; }
  uint32_t index_at(uvec2 at) const { return shelves_[at.y / kShelfHeight].slab_of_x[at.x / kUnit]; }
  uint64_t texels_in(const Slab& slab) const { return uint64_t{slab.used} * slab.width * kUnit * kUnit; }
  // How many shelves a new slab should take: at least for `rows`.
  uint32_t shelves_for(uint32_t width, uint32_t rows) const;
  // `shelves` from `first` on, a multiple of it; fewer at the end of the atlas.
  std::span<const Shelf> shelves_from(uint32_t first, uint32_t shelves) const;
  static uint32_t height_of(std::span<const Shelf> shelves);  // units
  std::optional<uint32_t> find_gap(std::span<const Shelf> shelves, uint32_t width);
  // The slabs that stand in any of `width` units from `x` on.
  std::vector<uint32_t> slabs_within(std::span<const Shelf> shelves, uint32_t x, uint32_t width) const;
  std::optional<uvec2> find(uint32_t width, uint32_t rows, bool may_draw);
  std::optional<uvec2> take(uint32_t slab, uint32_t rows);
  std::optional<uvec2> take_from_width(uint32_t width, uint32_t rows);
  std::optional<uint32_t> draw_slab(uint32_t width, uint32_t rows);
  std::optional<uint32_t> draw_slab_of(uint32_t width, uint32_t rows, uint32_t shelves);
  uint32_t add_slab(const Slab& slab);
  void release(uint32_t slab);

  std::vector<Shelf> shelves_;
  std::vector<Slab> slabs_;                                               // some unused
  std::vector<uint32_t> unused_;                                          // indices of slabs_
  std::array<std::vector<uint32_t>, kLongestSide / kUnit + 1> by_width_;  // by units, in the order of drawing
  std::array<uint16_t, kLongestSide / kUnit + 1> no_slab_for_;            // rows, by width, since a release
  std::vector<uint8_t> taken_;                                            // scratch of find_gap()
  uint64_t capacity_texels_ = 0, used_texels_ = 0;
};

}  // namespace tessera::atlas::coherent
