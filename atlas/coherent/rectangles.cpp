#include "atlas/coherent/rectangles.h"

#include <algorithm>
#include <cmath>

namespace tessera::atlas::coherent {
namespace {

// Widths of slabs: few enough to share slabs, close enough that the shape is off by a fifth at most, or a
// third where they are small. Whole squares but for the smallest.
constexpr uint16_t kWidths[] = {2, 4, 6, 8, 12, 16, 24, 32, 40, 48, 64, 80, 96, 128, 160, 192, 256};

constexpr float kMostExcess = 1.25f;  // of height, for a width that is too small

// What is held: neither side may have much fewer samples than wished, which shows; both together not many
// more, which costs others theirs. Wide bounds: what is placed anew costs bits.
constexpr float kSparsest = 0.7f, kDensest = 2.5f;

struct WidthTable {
  // By the wish in whole texels; of two at the same distance the wider.
  std::array<uint16_t, kLongestSide + 1> nearest{};
  constexpr WidthTable() {
    for (size_t wish = 0; wish < nearest.size(); ++wish) {
      nearest[wish] = kWidths[0];
      for (const uint16_t width : kWidths) {
        const auto distance = [&](uint16_t w) { return w > wish ? w - wish : wish - w; };
        if (distance(width) <= distance(nearest[wish])) nearest[wish] = width;
      }
    }
  }
};
constexpr WidthTable kWidthTable;

uint16_t multiple_near(float texels, uint32_t step, uint32_t most) {
  const float steps = texels / static_cast<float>(step) + 0.5f;
  const uint32_t most_steps = most / step;
  return static_cast<uint16_t>(step * static_cast<uint32_t>(std::clamp(steps, 1.0f, float(most_steps))));
}

// Even up to a square, then halves of squares up to two, then whole ones.
uint16_t height_near(float texels, uint32_t most) {
  if (texels < kSquare + 1 || most < kSquare) return multiple_near(texels, 2, most);
  return multiple_near(texels, texels < 2 * kSquare ? kSquare / 2 : kSquare, most);
}

// The widest that is no wider.
uint16_t width_within(uint32_t most) {
  return *(std::ranges::upper_bound(kWidths, most) - 1);
}

uint16_t next_width(uint16_t width) {
  return *std::ranges::upper_bound(kWidths, width);
}

// In texels along the patch's axes, before it is held back by that of the last frame.
struct Wish {
  RectangleSize size;
  float u, v;  // what was rounded to it; no more than it may stand for
};

Wish wish(const RectangleNeed& need, bool masked, float scale, const MostSides& most) {
  const uint16_t widest = width_within(masked ? std::max(most.width / 2, 2) : most.width);
  const uint32_t highest = masked ? std::max(most.height / 4 * 2, 2) : most.height;
  const bool u_is_long = need.u >= need.v;
  const float across = scale * (u_is_long ? need.v : need.u);
  // A sliver gets two texels of height and pays for them with its length: otherwise slivers would hold texels
  // that others make more of.
  const float height_intervals = std::max(across, 1.0f);
  const float length = scale * (u_is_long ? need.u : need.v) * across / height_intervals;
  // The height makes up for the width's rounding, so that the area stays.
  const auto height_at = [&](uint16_t width) {
    return height_near(height_intervals * std::min(length / static_cast<float>(width - 1), kMostExcess) + 1,
                       highest);
  };
  uint16_t width = std::min(kWidthTable.nearest[multiple_near(length + 1, 1, kLongestSide)], widest);
  uint16_t height = height_at(width);
  if (height > width) {
    // Nearly a square: one of the next width if that has no fewer samples where it has fewest, else cut off.
    const uint16_t wider = width < widest ? next_width(width) : width;
    const uint16_t flatter = std::min(height_at(wider), wider);
    if (static_cast<float>(flatter - 1) * length >= static_cast<float>(width - 1) * height_intervals) {
      width = wider;
      height = flatter;
    } else {
      height = width;
    }
  }
  const float exact_width = std::min(length + 1, static_cast<float>(width) / kSparsest);
  const float exact_height = std::min(height_intervals + 1, static_cast<float>(height) / kSparsest);
  if (u_is_long) return {{width, height}, exact_width, exact_height};
  return {{height, width}, exact_height, exact_width};
}

bool still_fits(const RectangleSize& held, const Wish& wished) {
  const auto enough = [](float has, float wish) { return has >= std::min(kSparsest * wish, wish - 2); };
  return enough(held.u, wished.u) && enough(held.v, wished.v) &&
         static_cast<float>(held.u * held.v) <= kDensest * wished.u * wished.v;
}

bool is_color(const RectangleNeed& need, bool masked, float color_area) {
  return !(need.area * (masked ? 2.0f : 1.0f) >= color_area);  // true for NaN
}

uint64_t texels(const RectangleSize& size, bool masked) {
  return (masked ? 2u : 1u) * uint64_t{size.u} * size.v;
}

}  // namespace

MostSides most_sides(uint32_t atlas_width, uint32_t atlas_height) {
  return {static_cast<uint16_t>(std::min(atlas_width, kLongestSide)),
          static_cast<uint16_t>(std::min(atlas_height, kLongestSide))};
}

RectangleNeed rectangle_need(const scene::Footprint& footprint, uint8_t triangle_count) {
  const BlockNeed need = block_need(footprint, {.triangle_count = triangle_count});
  const float length = std::sqrt(need.area * need.elongation);
  const float width = length / need.elongation;
  return need.upright ? RectangleNeed{width, length, need.area} : RectangleNeed{length, width, need.area};
}

RectangleSize select_size(const RectangleNeed& need, bool masked, float bias, const RectangleSize* previous,
                          const LevelSettings& settings, const MostSides& most) {
  float color_area = settings.color_area_px2 * std::exp2(bias);
  if (previous)
    color_area *= std::exp2(previous->single_color() ? settings.hysteresis : -settings.hysteresis);
  if (is_color(need, masked, color_area)) return {};
  const Wish wished = wish(need, masked, std::exp2(-0.5f * bias), most);
  const bool stays = previous && !previous->single_color() && still_fits(*previous, wished);
  return stays ? *previous : wished.size;
}

uvec2 sides_of(const RectangleSize& size, bool masked) {
  const uint32_t width = std::max(size.u, size.v), height = std::min(size.u, size.v);
  if (!masked) return {width, height};
  // A block is split across its longer side (atlas/placement.h).
  return width > 2 * height ? uvec2(2 * width, height) : uvec2(width, 2 * height);
}

float select_bias(std::span<const Wanted> wanted, double target_texels, const LevelSettings& settings,
                  const MostSides& most, float near) {
  // As select_size() without `previous`; powers of the bias once, not for every patch.
  const auto fits = [&](float bias) {
    const float color_area = settings.color_area_px2 * std::exp2(bias), scale = std::exp2(-0.5f * bias);
    uint64_t sum = 0;
    for (const Wanted& w : wanted)
      if (!is_color(w.need, w.masked, color_area))
        sum += texels(wish(w.need, w.masked, scale, most).size, w.masked);
    return static_cast<double>(sum) <= target_texels;
  };
  return least_bias(settings, fits, near);
}

}  // namespace tessera::atlas::coherent
