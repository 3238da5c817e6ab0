#include "atlas/coherent/rectangles.h"

#include <algorithm>
#include <cmath>

namespace tessera::atlas::coherent {
namespace {

// Widths of slabs: few enough to share slabs, close enough that density is off by an eighth at most.
constexpr uint16_t kWidths[] = {2,  4,  6,  8,  10, 12, 14,  16,  20,  24,  28,  32,
                                40, 48, 56, 64, 80, 96, 112, 128, 160, 192, 224, 256};

struct WidthTable {
  // By half the wish, rounded.
  std::array<uint16_t, kShelfHeight / 2 + 1> nearest{};
  constexpr WidthTable() {
    for (size_t i = 0; i < nearest.size(); ++i) {
      nearest[i] = kWidths[0];
      for (const uint16_t width : kWidths) {
        const auto distance = [&](uint16_t w) { return w > 2 * i ? w - 2 * i : 2 * i - w; };
        if (distance(width) < distance(nearest[i])) nearest[i] = width;
      }
    }
  }
};
constexpr WidthTable kWidthTable;

uint16_t even(float texels, uint32_t most) {
  const float half = std::clamp(0.5f * texels + 0.5f, 1.0f, 0.5f * static_cast<float>(most));
  return static_cast<uint16_t>(2 * static_cast<uint32_t>(half));
}

// The widest that is no wider.
uint16_t width_within(uint32_t most) {
  return *(std::ranges::upper_bound(kWidths, most) - 1);
}

// Before the size is held back by that of the last frame.
RectangleSize wish(const RectangleNeed& need, bool masked, float scale, const MostSides& most) {
  const uint32_t longest = masked ? most.height / 4 * 2 : most.height;
  const bool u_is_short = need.u <= need.v;
  const float short_intervals = scale * (u_is_short ? need.u : need.v);
  const float long_intervals = scale * (u_is_short ? need.v : need.u);
  const uint16_t width = std::min(kWidthTable.nearest[even(short_intervals + 1, longest) / 2],
                                  width_within(std::min<uint32_t>(longest, most.width)));
  // The length makes up for the width's rounding, so that the area stays. A sliver pays for its two texels of
  // width with its length: otherwise slivers would hold texels that wide patches make more of.
  const float excess = std::min(short_intervals / static_cast<float>(width - 1), 1.25f);
  uint16_t length = even(long_intervals * excess + 1, longest);
  length = std::max(length, width);
  return u_is_short ? RectangleSize{width, length} : RectangleSize{length, width};
}

bool near(uint16_t wished, uint16_t held, float hysteresis) {
  const float margin = std::max(2.0f, hysteresis * static_cast<float>(held));
  return std::abs(static_cast<float>(wished) - static_cast<float>(held)) <= margin;
}

uint64_t texels(const RectangleSize& size, bool masked) {
  return (masked ? 2u : 1u) * uint64_t{size.u} * size.v;
}

}  // namespace

MostSides most_sides(uint32_t atlas_width, uint32_t atlas_height) {
  return {static_cast<uint16_t>(std::min(atlas_width, kShelfHeight)),
          static_cast<uint16_t>(std::min(atlas_height, kShelfHeight))};
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
  if (!(need.area * (masked ? 2.0f : 1.0f) >= color_area)) return {};
  const RectangleSize size = wish(need, masked, std::exp2(-0.5f * bias), most);
  const bool stays = previous && !previous->single_color() &&
                     near(size.u, previous->u, settings.hysteresis) &&
                     near(size.v, previous->v, settings.hysteresis);
  return stays ? *previous : size;
}

uvec2 sides_of(const RectangleSize& size, bool masked) {
  const uint32_t width = std::min(size.u, size.v), length = std::max(size.u, size.v);
  return {width, masked ? 2 * length : length};
}

float select_bias(std::span<const Wanted> wanted, double target_texels, const LevelSettings& settings,
                  const MostSides& most) {
  const auto fits = [&](float bias) {
    uint64_t sum = 0;
    for (const Wanted& w : wanted)
      sum += texels(select_size(w.need, w.masked, bias, nullptr, settings, most), w.masked);
    return static_cast<double>(sum) <= target_texels;
  };
  return least_bias(settings, fits);
}

}  // namespace tessera::atlas::coherent
