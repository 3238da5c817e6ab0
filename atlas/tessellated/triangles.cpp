#include "atlas/tessellated/triangles.h"

#include <algorithm>
#include <cmath>

#include "atlas/addressing/addressing.h"
#include "atlas/tessellated/packing.h"
#include "base/triangle_angles.h"

namespace tessera::atlas::tessellated {
namespace {

struct Angles {
  std::array<double, 3> side;  // radians, by the corner opposite
  double area;                 // steradians, flat
  std::array<double, 3> distance;
};

Angles angles_of(const scene::Geometry& geometry, uint32_t triangle, const dmat4& transform,
                 const dvec3& eye) {
  Angles a{};
  std::array<dvec3, 3> to;
  for (uint32_t c = 0; c < 3; ++c) {
    const vec3 local = geometry.vertices[geometry.indices[3 * size_t{triangle} + c]].position;
    const dvec3 d = dvec3(transform * glm::dvec4(dvec3(local), 1)) - eye;
    a.distance[c] = glm::length(d);
    to[c] = scaled_to_one(d);
  }
  for (uint32_t c = 0; c < 3; ++c) a.side[c] = angle_between(to[(c + 1) % 3], to[(c + 2) % 3]);
  a.area = area_from_sides(a.side[0], a.side[1], a.side[2]);
  return a;
}

// Sum of values of 0 or more, of which some may be no number.
double positive(double value) {
  return value > 0 && std::isfinite(value) ? value : 0;
}

TriangleNeed need_of(const Angles& a, double area_px2, double px_per_rad, double longest_px) {
  TriangleNeed need;
  const auto longest = std::max_element(a.side.begin(), a.side.end());
  need.apex = static_cast<uint8_t>(longest - a.side.begin());
  need.area = static_cast<float>(area_px2);
  need.base = static_cast<float>(std::min(*longest * px_per_rad, longest_px));
  // From the first corner of the base: by the law of cosines.
  const double base = *longest, second = a.side[(need.apex + 1) % 3], first = a.side[(need.apex + 2) % 3];
  const double foot = 0.5 + 0.5 * (first - second) * (first + second) / (base * base);
  need.foot = foot >= 0 ? static_cast<float>(std::min(foot, 1.0)) : 0.0f;
  return need;
}

SpacingCode code(double distance, double reference) {
  return reference > 0 ? spacing_code(distance / reference) : SpacingCode{0};
}

int round_to_int(float value, int most) {
  return value < static_cast<float>(most) ? static_cast<int>(value + 0.5f) : most;
}

Shape l_shape(float area, const ShapeLimits& limits) {
  const float level = std::sqrt(area * (4.0f / 3.0f));
  const int splits =
      std::clamp(static_cast<int>(std::ceil(std::min(level / static_cast<float>(limits.level), 100.0f))), 1,
                 addressing::kMaxSplits);
  const int each = std::max(round_to_int(level / static_cast<float>(splits), limits.level), 1);
  return {
      .kind = PlacementKind::l, .level = static_cast<uint8_t>(each), .splits = static_cast<uint8_t>(splits)};
}

}  // namespace

uint32_t see(const scene::Geometry& geometry, const scene::Patch& patch, const scene::Footprint& footprint,
             const dmat4& transform, const dvec3& eye, std::span<SeenTriangle, 3> out) {
  std::array<Angles, 3> angles;
  double area = 0;
  const uint32_t count = patch.triangle_count;
  for (uint32_t t = 0; t < count; ++t) {
    angles[t] = angles_of(geometry, patch.first_triangle + t, transform, eye);
    area += positive(angles[t].area);
  }
  const double area_px2 = positive(footprint.area_px2);
  // No edge is longer than both axes together, however flat the eye of this frame sees what others see more
  // of.
  const double longest_px = positive(footprint.u_px) + positive(footprint.v_px);
  const double px_per_rad = std::sqrt(area_px2 / area);
  for (uint32_t t = 0; t < count; ++t) {
    const Angles& a = angles[t];
    const double share = area > 0 ? positive(a.area) / area : 1.0 / count;
    out[t].need = need_of(a, share * area_px2, px_per_rad, longest_px);
    out[t].spacing = {code(a.distance[1], a.distance[0]), code(a.distance[2], a.distance[0])};
  }
  return count;
}

ShapeLimits limits_for(uint32_t atlas_width, uint32_t atlas_height) {
  const auto width = static_cast<int>(atlas_width), height = static_cast<int>(atlas_height);
  ShapeLimits limits{.level = addressing::kMaxTessellationLevel,
                     .half_length = std::min(addressing::kMaxHalfLength, width - 1),
                     .half_width = std::min(addressing::kMaxHalfWidth, height - 1)};
  const auto fits = [&] {
    const glm::ivec2 pitch = addressing::l_pair_pitch(limits.level);
    return pitch.x <= width && pitch.y <= height;
  };
  while (limits.level > 1 && !fits()) --limits.level;
  return limits;
}

Shape select_shape(const TriangleNeed& need, float bias, const LayoutSettings& settings,
                   const ShapeLimits& limits) {
  const float area = need.area * std::exp2(-bias);
  if (!(area * (need.masked ? 2.0f : 1.0f) >= settings.levels.color_area_px2)) return {};
  const float height = 2 * need.area / need.base;
  if (need.masked || !(need.base > settings.slantedness * height)) return l_shape(area, limits);

  const float scale = std::exp2(-0.5f * bias);
  const int across = std::max(round_to_int(height * scale, limits.half_width + 1), 1);
  // Of what is lower than a pixel, and takes two rows of samples all the same, not all detail along its
  // length reaches the screen.
  const float base = need.base * scale * std::min(1.0f, height * scale);
  const std::array<float, 2> parts{base * need.foot, base * (1 - need.foot)};
  Shape shape{.kind = PlacementKind::halves, .across = static_cast<uint8_t>(across)};
  for (int half = 0; half < 2; ++half) {
    const int along = std::max(round_to_int(parts[half], limits.half_length + 1), 1);
    if (across > limits.half_width || along > limits.half_length) return l_shape(area, limits);
    shape.along[half] = static_cast<uint16_t>(along);
  }
  return shape;
}

uint64_t texels_of(const Shape& shape, bool masked) {
  switch (shape.kind) {
    case PlacementKind::l: {
      const glm::ivec2 pitch = addressing::l_pair_pitch(shape.level);
      const uint64_t ls = uint64_t{shape.splits} * shape.splits * (masked ? 2 : 1);
      return ls * static_cast<uint64_t>(pitch.x * pitch.y) / 2;
    }
    case PlacementKind::halves: {
      uint64_t texels = 0;
      for (const uint16_t along : shape.along) {
        // Half of a pair of equal ones.
        const glm::ivec2 size = addressing::half_staircase(shape.across, along);
        const int length = nesting_offset(size, size) + size.y + 1;
        texels += static_cast<uint64_t>(length * half_row_height(size)) / 2;
      }
      return texels;
    }
    default:
      return 0;
  }
}

float select_bias(std::span<const TriangleNeed> needs, double target_texels, const LayoutSettings& settings,
                  const ShapeLimits& limits) {
  const auto fits = [&](float bias) {
    uint64_t sum = 0;
    for (const TriangleNeed& need : needs)
      sum += texels_of(select_shape(need, bias, settings, limits), need.masked);
    return static_cast<double>(sum) <= target_texels;
  };
  return least_bias(settings.levels, fits);
}

}  // namespace tessera::atlas::tessellated
