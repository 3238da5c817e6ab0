#include "shading/shadow_fit.h"

#include <algorithm>
#include <cmath>

#include "base/view.h"
#include "shading/draw_list.h"

namespace tessera::shading {
namespace {

// One axis' extents of meshlets, weighted by their triangles.
class Extent {
 public:
  void add(double center, double radius, uint32_t weight) {
    lows_.push_back({center - radius, weight});
    highs_.push_back({center + radius, weight});
    min_ = std::min(min_, center - radius);
    max_ = std::max(max_, center + radius);
    total_ += weight;
  }
  bool empty() const { return lows_.empty(); }
  std::pair<double, double> all() const { return {min_, max_}; }

  // Everything if that is at most twice what holds the central 98 %, else that.
  std::pair<double, double> main() {
    const double low = quantile(lows_, 0.01), high = quantile(highs_, 0.99);
    return max_ - min_ <= 2 * (high - low) ? all() : std::pair(low, high);
  }

 private:
  using Weighted = std::pair<double, uint32_t>;
  double quantile(std::vector<Weighted>& values, double share) const {
    std::sort(values.begin(), values.end());
    uint64_t sum = 0;
    for (const auto& [value, weight] : values)
      if (sum += weight; static_cast<double>(sum) >= share * static_cast<double>(total_)) return value;
    return values.back().first;
  }

  std::vector<Weighted> lows_, highs_;
  double min_ = std::numeric_limits<double>::infinity(), max_ = -min_;
  uint64_t total_ = 0;
};

// Rows: right, up, towards the light.
glm::dmat3 light_axes(const dvec3& direction) {
  const dvec3 z = -direction;
  const dvec3 helper = std::abs(z.y) < 0.99 ? dvec3(0, 1, 0) : dvec3(1, 0, 0);
  const dvec3 x = glm::normalize(glm::cross(helper, z));
  return glm::transpose(glm::dmat3(x, glm::cross(z, x), z));
}

}  // namespace

ShadowFit fit_sun(const scene::Scene& scene, const std::vector<dmat4>& transforms, const dvec3& direction,
                  uint32_t side_texels) {
  const glm::dmat3 axes = light_axes(direction);
  Extent extents[3];
  for (size_t i = 0; i < scene.instances.size(); ++i)
    for (const scene::Meshlet& m : scene.geometries[scene.instances[i].geometry].meshlets) {
      const WorldSphere s = transform_sphere(transforms[i], m.center, m.radius);
      const dvec3 p = axes * s.center;
      for (int a = 0; a < 3; ++a) extents[a].add(p[a], s.radius, m.triangle_count);
    }
  if (extents[0].empty()) return {};
  const auto [x0, x1] = extents[0].main();
  const auto [y0, y1] = extents[1].main();
  const auto [z0, z1] = extents[2].all();
  const double side = std::max({x1 - x0, y1 - y0, 1e-6});
  const double depth = std::max(z1 - z0, 1e-6);
  dmat4 fit(1);
  const dvec3 scale(2 / side, 2 / side, 1 / depth);
  const dvec3 middle(0.5 * (x0 + x1), 0.5 * (y0 + y1), z0);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) fit[column][row] = scale[row] * axes[column][row];
    fit[3][row] = -scale[row] * middle[row];
  }
  return {fit, side / side_texels};
}

ShadowFit fit_spot(const PlacedLight& spot, uint32_t side_texels) {
  constexpr float kMaxHalfAngle = 1.4835f;  // 85 degrees
  // A few texels wider than the cone, for the filter's reach.
  const float tangent = std::tan(std::clamp(spot.light.outer_cone_rad, 0.01f, kMaxHalfAngle)) *
                        (1 + 8.0f / static_cast<float>(side_texels));
  const Fov fov{-tangent, tangent, -tangent, tangent};
  const glm::dmat3 axes = light_axes(spot.direction);  // rows; the light looks along its -Z
  dmat4 view(axes);
  view[3] = glm::dvec4(-(axes * spot.position), 1.0);
  return {dmat4(projection_matrix(fov, kDefaultNearM)) * view, 2.0 * tangent / side_texels};
}

}  // namespace tessera::shading
