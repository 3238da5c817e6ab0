#include "atlas/coherent/slabs.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <functional>

namespace tessera::atlas::coherent {
namespace {

using Bits = unsigned __int128;

constexpr uint16_t kAnyRows = UINT16_MAX;
constexpr uint64_t kSlabsInAtlas = 256;  // at least, but where they are as low as they can be

Bits low_bits(uint32_t count) {
  return count >= 128 ? ~Bits{0} : (Bits{1} << count) - 1;
}

int lowest_bit(Bits bits) {
  const auto low = static_cast<uint64_t>(bits);
  return low ? std::countr_zero(low) : 64 + std::countr_zero(static_cast<uint64_t>(bits >> 64));
}

int highest_bit(Bits bits) {
  const auto high = static_cast<uint64_t>(bits >> 64);
  return high ? 127 - std::countl_zero(high) : 63 - std::countl_zero(static_cast<uint64_t>(bits));
}

constexpr uint32_t kSquareUnits = kSquare / kUnit;

// Of what a side starts at multiples of: as its own length, at most a square. All in units.
uint32_t step_of(uint32_t side) {
  return std::min(side & -side, kSquareUnits);
}

bool is_square_wise(uint32_t side) {
  return side % kSquareUnits == 0;
}

// A bit at each multiple of a step.
constexpr Bits multiples_of(uint32_t step) {
  constexpr auto twice = [](uint64_t half) { return Bits{half} << 64 | half; };
  return step == 1 ? ~Bits{0} : step == 2 ? twice(0x5555555555555555) : twice(0x1111111111111111);
}

// Where a run of `length` ones starts, at a multiple of its step, or -1: the lowest if it is whole squares,
// else the highest.
int find_run(Bits bits, uint32_t length) {
  // After each step a bit stands for a run of `have` ones that starts there.
  for (uint32_t have = 1; have < length && bits;) {
    const uint32_t step = std::min(have, length - have);
    bits &= bits >> step;
    have += step;
  }
  bits &= multiples_of(step_of(length));
  if (!bits) return -1;
  return is_square_wise(length) ? lowest_bit(bits) : highest_bit(bits);
}

// Where so many zeros start, at a multiple of their step.
std::optional<uint32_t> first_gap(const std::vector<uint8_t>& taken, uint32_t length) {
  const uint32_t step = step_of(length);
  const auto begin = taken.begin();
  for (uint32_t at = 0; at + length <= taken.size();) {
    const auto from = std::make_reverse_iterator(begin + at + length),
               to = std::make_reverse_iterator(begin + at);
    const auto in_the_way = std::find(from, to, 1);
    if (in_the_way == to) return at;
    at = (static_cast<uint32_t>(in_the_way.base() - begin) + step - 1) / step * step;
  }
  return std::nullopt;
}

std::optional<uint32_t> last_gap(const std::vector<uint8_t>& taken, uint32_t length) {
  const uint32_t step = step_of(length);
  const auto begin = taken.begin();
  for (auto end = static_cast<uint32_t>(taken.size()); end >= length;) {
    const uint32_t at = (end - length) / step * step;
    const auto in_the_way = std::find(begin + at, begin + at + length, 1);
    if (in_the_way == begin + at + length) return at;
    end = static_cast<uint32_t>(in_the_way - begin);
  }
  return std::nullopt;
}

}  // namespace

Slabs::Slabs(uint32_t width, uint32_t height) : capacity_texels_(uint64_t{width} * height) {
  assert(width % kUnit == 0 && height % kUnit == 0);
  no_slab_for_.fill(kAnyRows);
  for (uint32_t y = 0; y < height; y += kShelfHeight) {
    const uint32_t units = width / kUnit;
    shelves_.push_back({.units = std::min(kShelfHeight, height - y) / kUnit,
                        .free_units = units,
                        .taken = std::vector<uint8_t>(units),
                        .slab_of_x = std::vector<uint32_t>(units)});
  }
}

std::optional<uvec2> Slabs::take(uint32_t index, uint32_t rows) {
  Slab& slab = slabs_[index];
  const int at = slab.closed ? -1 : find_run(slab.free_rows, rows);
  if (at < 0) return std::nullopt;
  slab.free_rows &= ~(low_bits(rows) << at);
  slab.used = static_cast<uint16_t>(slab.used + rows);
  return uvec2(slab.x * kUnit, slab.shelf * kShelfHeight + static_cast<uint32_t>(at) * kUnit);
}

std::optional<uvec2> Slabs::take_from_width(uint32_t width, uint32_t rows) {
  for (const uint32_t index : by_width_[width]) {
    const Slab& slab = slabs_[index];
    if (slab.used + rows > slab.height) continue;
    if (const auto at = take(index, rows)) return at;
  }
  return std::nullopt;
}

std::optional<uvec2> Slabs::allocate(uint32_t width, uint32_t height, bool may_draw) {
  assert(width >= kUnit && width <= kLongestSide && height >= kUnit && height <= kLongestSide);
  const auto at = find(width / kUnit, height / kUnit, may_draw);
  if (at) used_texels_ += uint64_t{width} * height;
  return at;
}

std::optional<uvec2> Slabs::find(uint32_t width, uint32_t rows, bool may_draw) {
  if (const auto at = take_from_width(width, rows)) return at;
  if (!may_draw) return std::nullopt;
  if (const auto slab = draw_slab(width, rows)) return take(*slab, rows);
  // Better too wide than none.
  for (uint32_t wider = width + 1; wider <= std::min(4 * width, kLongestSide / kUnit); ++wider) {
    if (const auto at = take_from_width(wider, rows)) return at;
  }
  return std::nullopt;
}

uint32_t Slabs::height_of(std::span<const Shelf> shelves) {
  uint32_t units = 0;
  for (const Shelf& shelf : shelves) units += shelf.units;
  return units;
}

uint32_t Slabs::shelves_for(uint32_t width, uint32_t rows) const {
  const auto texels = [&](uint32_t shelves) { return uint64_t{width} * kUnit * shelves * kShelfHeight; };
  uint32_t shelves = kMostShelves;
  while (shelves > 1 && shelves / 2 * kShelfHeight >= rows * kUnit &&
         texels(shelves) * kSlabsInAtlas > capacity_texels_)
    shelves /= 2;
  return shelves;
}

std::span<const Slabs::Shelf> Slabs::shelves_from(uint32_t first, uint32_t shelves) const {
  return std::span(shelves_).subspan(first, std::min<size_t>(shelves, shelves_.size() - first));
}

std::optional<uint32_t> Slabs::find_gap(std::span<const Shelf> shelves, uint32_t width) {
  if (std::ranges::any_of(shelves, [&](const Shelf& s) { return s.free_units < width; })) return std::nullopt;
  taken_ = shelves[0].taken;
  for (const Shelf& shelf : shelves.subspan(1))
    std::ranges::transform(taken_, shelf.taken, taken_.begin(), std::bit_or());
  return is_square_wise(width) ? first_gap(taken_, width) : last_gap(taken_, width);
}

// A lower one if there is no room for the best. What found none need not look again until some is given back:
// where thousands come into view, that is most of the work.
std::optional<uint32_t> Slabs::draw_slab(uint32_t width, uint32_t rows) {
  if (rows >= no_slab_for_[width]) return std::nullopt;
  for (uint32_t shelves = shelves_for(width, rows); shelves * kShelfHeight >= rows * kUnit; shelves /= 2) {
    if (const auto slab = draw_slab_of(width, rows, shelves)) return slab;
  }
  no_slab_for_[width] = static_cast<uint16_t>(rows);
  return std::nullopt;
}

std::optional<uint32_t> Slabs::draw_slab_of(uint32_t width, uint32_t rows, uint32_t shelves) {
  for (uint32_t first = 0; first < shelves_.size(); first += shelves) {
    const std::span<const Shelf> room = shelves_from(first, shelves);
    const uint32_t height = height_of(room);
    if (height < rows) continue;
    if (const auto gap = find_gap(room, width))
      return add_slab({.x = static_cast<uint16_t>(*gap),
                       .width = static_cast<uint16_t>(width),
                       .height = static_cast<uint16_t>(height),
                       .shelf = static_cast<uint16_t>(first),
                       .shelves = static_cast<uint16_t>(room.size()),
                       .free_rows = low_bits(height)});
  }
  return std::nullopt;
}

uint32_t Slabs::add_slab(const Slab& slab) {
  if (unused_.empty()) {
    unused_.push_back(static_cast<uint32_t>(slabs_.size()));
    slabs_.emplace_back();
  }
  const uint32_t index = unused_.back();
  unused_.pop_back();
  slabs_[index] = slab;
  for (Shelf& shelf : std::span(shelves_).subspan(slab.shelf, slab.shelves)) {
    std::fill_n(shelf.taken.begin() + slab.x, slab.width, uint8_t{1});
    std::fill_n(shelf.slab_of_x.begin() + slab.x, slab.width, index);
    shelf.free_units -= slab.width;
  }
  by_width_[slab.width].push_back(index);
  return index;
}

void Slabs::free(uvec2 at, uint32_t width, uint32_t height) {
  const uint32_t index = index_at(at), rows = height / kUnit;
  Slab& slab = slabs_[index];
  const Bits freed = low_bits(rows) << ((at.y - slab.shelf * kShelfHeight) / kUnit);
  assert((slab.free_rows & freed) == 0);
  slab.free_rows |= freed;
  slab.used = static_cast<uint16_t>(slab.used - rows);
  used_texels_ -= uint64_t{width} * height;
  if (slab.used == 0) release(index);
}

void Slabs::release(uint32_t index) {
  const Slab& slab = slabs_[index];
  for (Shelf& shelf : std::span(shelves_).subspan(slab.shelf, slab.shelves)) {
    std::fill_n(shelf.taken.begin() + slab.x, slab.width, uint8_t{0});
    shelf.free_units += slab.width;
  }
  no_slab_for_.fill(kAnyRows);
  std::erase(by_width_[slab.width], index);
  unused_.push_back(index);
}

bool Slabs::close_emptiest(uint64_t budget_texels, float fullest) {
  struct Candidate {
    float share;
    uint32_t index;
  };
  std::vector<Candidate> candidates;
  std::array<uint32_t, kLongestSide / kUnit + 1> room{};  // rows free in slabs of a width
  for (const auto& slabs : by_width_) {
    for (const uint32_t index : slabs) {
      const Slab& slab = slabs_[index];
      if (slab.closed) continue;
      room[slab.width] += slab.height - slab.used;
      const float share = static_cast<float>(slab.used) / static_cast<float>(slab.height);
      if (share <= fullest) candidates.push_back({share, index});
    }
  }
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    return a.share != b.share ? a.share < b.share : a.index < b.index;
  });
  bool closed = false;
  for (const Candidate& candidate : candidates) {
    Slab& slab = slabs_[candidate.index];
    const uint64_t texels = texels_in(slab);
    // All of its height is no longer there: the free part, and what the rest takes elsewhere.
    if (texels > budget_texels || room[slab.width] < slab.height) continue;
    room[slab.width] -= slab.height;
    budget_texels -= texels;
    slab.closed = closed = true;
  }
  return closed;
}

std::vector<uint32_t> Slabs::slabs_within(std::span<const Shelf> shelves, uint32_t x, uint32_t width) const {
  std::vector<uint32_t> within;
  for (const Shelf& shelf : shelves) {
    for (uint32_t at = x; at < x + width;) {
      if (!shelf.taken[at]) {
        ++at;
        continue;
      }
      const uint32_t index = shelf.slab_of_x[at];
      if (std::ranges::find(within, index) == within.end()) within.push_back(index);
      at = slabs_[index].x + slabs_[index].width;
    }
  }
  return within;
}

bool Slabs::close_for(uint32_t width, uint32_t height, uint64_t budget_texels) {
  const uint32_t units = width / kUnit, rows = height / kUnit, shelves = shelves_for(units, rows);
  std::vector<uint32_t> cheapest;
  uint64_t least = budget_texels + 1;
  for (uint32_t first = 0; first < shelves_.size(); first += shelves) {
    const std::span<const Shelf> room = shelves_from(first, shelves);
    if (height_of(room) < rows) continue;
    for (uint32_t x = 0; x + units <= room[0].taken.size(); x += step_of(units)) {
      std::vector<uint32_t> within = slabs_within(room, x, units);
      uint64_t texels = 0;
      for (const uint32_t index : within) texels += texels_in(slabs_[index]);
      if (texels >= least) continue;
      least = texels;
      cheapest = std::move(within);
    }
  }
  for (const uint32_t index : cheapest) slabs_[index].closed = true;
  return !cheapest.empty();
}

void Slabs::reopen() {
  for (Slab& slab : slabs_) slab.closed = false;
}

SlabStats Slabs::stats() const {
  SlabStats stats{.used_texels = used_texels_, .capacity_texels = capacity_texels_};
  for (const Shelf& shelf : shelves_) {
    const uint64_t height = uint64_t{shelf.units} * kUnit;
    stats.slab_texels += (shelf.taken.size() - shelf.free_units) * kUnit * height;
  }
  return stats;
}

float Slabs::free_share() const {
  const SlabStats all = stats();
  return 1 - static_cast<float>(all.slab_texels) / static_cast<float>(all.capacity_texels);
}

}  // namespace tessera::atlas::coherent
