#include "bench/texel_shading.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "atlas/addressing/addressing.h"

namespace tessera::bench {
namespace {

using glm::dvec2;
namespace addressing = atlas::addressing;

constexpr uint32_t kMaxPatchSide = 8192;  // texels
constexpr double kLeastDensity = 1e-9, kMostDensity = 1e9;

uint32_t side_of(double metres, double texels_per_metre) {
  const double texels = std::ceil(metres * texels_per_metre) + 1;  // corners lie at texel centres
  return texels < kMaxPatchSide ? std::max(2u, static_cast<uint32_t>(texels))
                                : kMaxPatchSide;  // NaN: largest
}

uint32_t whole_tiles(uint32_t texels) {
  return (texels + kTexelTile - 1) / kTexelTile * kTexelTile;
}

// A pixel in the plane of a triangle: weights of its second and third corner, and their steps to the next
// pixels.
struct PixelPoint {
  dvec2 weights{0}, ddx{0}, ddy{0};
};

// Möller-Trumbore, as triangle_point() in shading/shaders/view.glsl.
PixelPoint pixel_point(const View& view, uvec2 pixel, const std::array<dvec3, 3>& corners) {
  const glm::dmat3 axes = glm::mat3_cast(normalized(view.pose).orientation);
  const Fov& f = view.fov;
  const dvec3 ray_x = axes[0] * (double{f.right - f.left} / view.width);
  const dvec3 ray_y = axes[1] * (double{f.down - f.up} / view.height);
  const dvec3 ray = axes * dvec3(f.left, f.up, -1) + (pixel.x + 0.5) * ray_x + (pixel.y + 0.5) * ray_y;
  const dvec3 edge1 = corners[1] - corners[0], edge2 = corners[2] - corners[0];
  const dvec3 to_eye = view.pose.position - corners[0];
  const dvec3 p = glm::cross(edge2, to_eye), q = glm::cross(to_eye, edge1), n = glm::cross(edge2, edge1);
  const double det = glm::dot(ray, n);
  const double inverse = std::abs(det) > 1e-300 ? 1 / det : 0;
  PixelPoint at;
  dvec2 w = dvec2(glm::dot(ray, p), glm::dot(ray, q)) * inverse;
  at.ddx = (dvec2(glm::dot(ray_x, p), glm::dot(ray_x, q)) - w * glm::dot(ray_x, n)) * inverse;
  at.ddy = (dvec2(glm::dot(ray_y, p), glm::dot(ray_y, q)) - w * glm::dot(ray_y, n)) * inverse;
  w.x = std::clamp(w.x, 0.0, 1.0);
  at.weights = {w.x, std::clamp(w.y, 0.0, 1 - w.x)};
  return at;
}

}  // namespace

std::vector<UniqueTexture::PatchSize> UniqueTexture::patch_sizes(const scene::Geometry& geometry,
                                                                 const dmat4& transform) {
  std::vector<PatchSize> sizes;
  sizes.reserve(geometry.patches.size());
  const glm::dmat3 linear(transform);
  for (const scene::Patch& patch : geometry.patches) {
    PatchSize size{0, 0};
    for (uint32_t t = 0; t < patch.triangle_count; ++t) {
      const uint32_t* indices = geometry.indices.data() + 3 * (size_t{patch.first_triangle} + t);
      for (uint32_t c = 0; c < 3; ++c) {
        const uint32_t next = (c + 1) % 3;
        const vec2 run = glm::abs(scene::patch_corner(patch.triangle_count, t, next) -
                                  scene::patch_corner(patch.triangle_count, t, c));
        const auto length =
            static_cast<float>(glm::length(linear * dvec3(geometry.vertices[indices[next]].position -
                                                          geometry.vertices[indices[c]].position)));
        if (run.y == 0) size.u_m = std::max(size.u_m, length / run.x);
        if (run.x == 0) size.v_m = std::max(size.v_m, length / run.y);
      }
    }
    sizes.push_back(size);
  }
  return sizes;
}

// Rows of patches, the highest first, in a rectangle that is about as wide as high.
UniqueTexture::Chart UniqueTexture::pack(std::span<const PatchSize> sizes, double texels_per_metre) {
  Chart chart;
  chart.patches.resize(sizes.size());
  double area = 0;
  uint32_t widest = 0;
  for (size_t i = 0; i < sizes.size(); ++i) {
    TexelRectangle& r = chart.patches[i];
    r = {0, 0, side_of(sizes[i].u_m, texels_per_metre), side_of(sizes[i].v_m, texels_per_metre)};
    area += double{1} * r.width * r.height;
    widest = std::max(widest, r.width);
  }
  chart.width = whole_tiles(std::max(widest, static_cast<uint32_t>(std::ceil(std::sqrt(area)))));
  chart.by_place.resize(sizes.size());
  std::iota(chart.by_place.begin(), chart.by_place.end(), 0u);
  std::ranges::stable_sort(chart.by_place, std::greater(),
                           [&](uint32_t patch) { return chart.patches[patch].height; });
  uint32_t x = 0;
  for (uint32_t i = 0; i < chart.by_place.size(); ++i) {
    TexelRectangle& r = chart.patches[chart.by_place[i]];
    if (chart.rows.empty() || x + r.width > chart.width) {
      const uint32_t y = chart.rows.empty() ? 0 : chart.rows.back().y + chart.rows.back().height;
      chart.rows.push_back({y, r.height, i, i});
      x = 0;
    }
    r.x = x;
    r.y = chart.rows.back().y;
    x += r.width;
    chart.rows.back().end = i + 1;
  }
  if (!chart.rows.empty()) chart.height = whole_tiles(chart.rows.back().y + chart.rows.back().height);
  return chart;
}

StatusOr<UniqueTexture> UniqueTexture::create(const scene::Scene& scene, std::span<const dmat4> transforms,
                                              uint64_t texels) {
  UniqueTexture result(scene);
  std::vector<std::vector<PatchSize>> sizes;
  for (size_t i = 0; i < scene.instances.size(); ++i)
    sizes.push_back(patch_sizes(scene.geometries[scene.instances[i].geometry], transforms[i]));
  const auto unwrap = [&](double density) {
    result.charts_.clear();
    for (const std::vector<PatchSize>& of_instance : sizes)
      result.charts_.push_back(pack(of_instance, density));
    result.texels_per_metre_ = density;
    return result.texels() <= texels;
  };
  if (!unwrap(kLeastDensity))
    return absl::InvalidArgumentError(absl::StrFormat(
        "texel shading: %u patches do not fit in a texture of %u texels, at least %u are needed",
        scene.patch_count, texels, result.texels()));
  double low = kLeastDensity, high = kMostDensity;
  while (high / low > 1.01) {
    const double middle = std::sqrt(low * high);
    (unwrap(middle) ? low : high) = middle;
  }
  unwrap(low);
  return result;
}

uint64_t UniqueTexture::texels() const {
  uint64_t sum = 0;
  for (const Chart& chart : charts_) sum += uint64_t{chart.width} * chart.height;
  return sum;
}

double UniqueTexture::texels_per_metre() const {
  return texels_per_metre_;
}

uint32_t UniqueTexture::levels(uint32_t instance) const {
  uint32_t levels = 1;
  for (uint32_t side = std::max(charts_[instance].width, charts_[instance].height); side > 1;
       side = (side + 1) / 2)
    ++levels;
  return levels;
}

uvec2 UniqueTexture::size(uint32_t instance, uint32_t level) const {
  const uint32_t up = (1u << level) - 1;
  return {(charts_[instance].width + up) >> level, (charts_[instance].height + up) >> level};
}

TexelPoint UniqueTexture::texel(uint32_t instance, uint32_t level, uvec2 texel) const {
  const Chart& chart = charts_[instance];
  const vec2 centre = (vec2(texel) + 0.5f) * static_cast<float>(1u << level) - 0.5f;
  const auto x = static_cast<uint32_t>(centre.x + 0.5f), y = static_cast<uint32_t>(centre.y + 0.5f);
  const auto row = std::ranges::upper_bound(chart.rows, y, {}, &Row::y);
  if (row == chart.rows.begin()) return {};
  const auto begin = chart.by_place.begin() + (row - 1)->begin, end = chart.by_place.begin() + (row - 1)->end;
  const auto after =
      std::upper_bound(begin, end, x, [&](uint32_t at, uint32_t p) { return at < chart.patches[p].x; });
  if (after == begin) return {};
  const uint32_t patch = *(after - 1);
  const TexelRectangle& r = chart.patches[patch];
  if (x >= r.x + r.width || y >= r.y + r.height) return {};
  const vec2 extent(static_cast<float>(r.width - 1), static_cast<float>(r.height - 1));
  return {patch, glm::clamp(centre - vec2(r.x, r.y), vec2(0), extent), extent};
}

TexelLookup UniqueTexture::lookup(uint32_t triangle, const View& view, uvec2 pixel,
                                  std::span<const dmat4> transforms) const {
  const scene::PatchId patch_id = patch_of_[triangle];
  const uint32_t i = scene_->instance_of(patch_id);
  const scene::Instance& instance = scene_->instances[i];
  const scene::Geometry& geometry = scene_->geometries[instance.geometry];
  const uint32_t in_geometry = triangle - instance.first_triangle;
  const scene::Patch& patch = geometry.patches[patch_id - instance.first_patch];
  const TexelRectangle& r = charts_[i].patches[patch_id - instance.first_patch];
  const vec2 extent(static_cast<float>(r.width - 1), static_cast<float>(r.height - 1));
  std::array<dvec3, 3> corners;
  std::array<dvec2, 3> texels;
  for (uint32_t c = 0; c < 3; ++c) {
    const vec3& position = geometry.vertices[geometry.indices[3 * size_t{in_geometry} + c]].position;
    corners[c] = dvec3(transforms[i] * glm::dvec4(dvec3(position), 1));
    texels[c] =
        dvec2(r.x, r.y) +
        dvec2(addressing::block_corner_texel(
            scene::patch_corner(patch.triangle_count, in_geometry - patch.first_triangle, c), extent));
  }
  const PixelPoint at = pixel_point(view, pixel, corners);
  const dvec2 e1 = texels[1] - texels[0], e2 = texels[2] - texels[0];
  const double longer =
      std::max(glm::length(at.ddx.x * e1 + at.ddx.y * e2), glm::length(at.ddy.x * e1 + at.ddy.y * e2));
  const double level =
      std::clamp(std::round(std::log2(std::max(longer, 1e-9))), 0.0, static_cast<double>(levels(i) - 1));
  const dvec2 base = texels[0] + at.weights.x * e1 + at.weights.y * e2;
  return {i, static_cast<uint32_t>(level), vec2((base + 0.5) / std::exp2(level) - 0.5)};
}

std::vector<TexelTile> UniqueTexture::visible_tiles(std::span<const uint32_t> triangle_plus_one,
                                                    const View& view,
                                                    std::span<const dmat4> transforms) const {
  std::vector<TexelTile> tiles;
  const auto add = [&](const TexelTile& tile) {
    if (tiles.empty() || tiles.back() != tile) tiles.push_back(tile);
  };
  for (size_t i = 0; i < triangle_plus_one.size(); ++i) {
    if (triangle_plus_one[i] == 0) continue;
    const uvec2 pixel(i % view.width, i / view.width);
    const TexelLookup at = lookup(triangle_plus_one[i] - 1, view, pixel, transforms);
    const uvec2 last = size(at.instance, at.level) - 1u;
    const uvec2 from(glm::max(at.position, vec2(0)));
    const uvec2 first_tile = glm::min(from, last) / kTexelTile;
    const uvec2 last_tile = glm::min(from + 1u, last) / kTexelTile;
    for (uint32_t y = first_tile.y; y <= last_tile.y; ++y)
      for (uint32_t x = first_tile.x; x <= last_tile.x; ++x) add({at.instance, at.level, x, y});
  }
  std::ranges::sort(tiles);
  const auto repeated = std::ranges::unique(tiles);
  tiles.erase(repeated.begin(), repeated.end());
  return tiles;
}

uint32_t UniqueTexture::samples(const TexelTile& tile) const {
  uint32_t samples = 0;
  const uvec2 end = size(tile.instance, tile.level);
  for (uint32_t i = 0; i < kTexelTileTexels; ++i) {
    const uvec2 at(tile.x * kTexelTile + i % kTexelTile, tile.y * kTexelTile + i / kTexelTile);
    if (at.x < end.x && at.y < end.y) samples += texel(tile.instance, tile.level, at).patch != scene::kNone;
  }
  return samples;
}

}  // namespace tessera::bench
