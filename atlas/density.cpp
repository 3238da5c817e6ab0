#include "atlas/density.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <numbers>
#include <utility>

namespace tessera::atlas {
namespace {

// Thesis 4.3, as measured by Guenter et al.
constexpr double kMarSlope = 0.022;         // m, degrees per degree
constexpr double kFovealMarDeg = 1 / 48.0;  // omega_0
constexpr double kDegreesPerRadian = 180 / std::numbers::pi;
// Where eq. 4.5 ends: p(1) of eq. 4.4.
constexpr double kBarrelRange = 1 + 0.22 + 0.24;

struct Corners {
  std::array<dvec3, kMaxPatchCorners> points;
  uint32_t count = 0;
  std::span<const dvec3> span() const { return {points.data(), count}; }
};

// In scene coordinates, each once.
Corners corners_of(const scene::Geometry& geometry, const scene::Patch& patch, const dmat4& transform) {
  const uint32_t* indices = geometry.indices.data() + 3 * size_t{patch.first_triangle};
  const uint32_t* end = indices + 3 * patch.triangle_count;
  Corners corners;
  for (const uint32_t* i = indices; i != end; ++i) {
    if (std::find(indices, i, *i) != i) continue;
    const dvec3 position(geometry.vertices[*i].position);
    corners.points[corners.count++] = dvec3(transform * glm::dvec4(position, 1.0));
  }
  return corners;
}

// Zero for a zero vector. Lengths near the ends of double's range would square out of it.
dvec3 unit(const dvec3& v) {
  const double largest = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
  return largest > 0 ? glm::normalize(v / largest) : dvec3(0);
}

double smallest_eccentricity(std::span<const dvec3> corners, std::span<const GazeRay> rays) {
  if (rays.empty()) return 0;
  double smallest = std::numbers::pi;
  for (const GazeRay& ray : rays) {
    smallest = std::min(smallest, eccentricity(corners, ray));
    if (smallest == 0) break;
  }
  return smallest;
}

// Of the node or its nearest ancestor that has one; null: none.
const ObjectPriority* priority_of(const scene::Scene& scene, uint32_t node,
                                  std::span<const ObjectPriority> priorities) {
  for (; node != scene::kNone; node = scene.nodes[node].parent) {
    const auto found = std::ranges::find(priorities, scene.nodes[node].name, &ObjectPriority::node);
    if (found != priorities.end()) return &*found;
  }
  return nullptr;
}

Status check_priority(const scene::Scene& scene, const ObjectPriority& priority) {
  if (!(priority.density >= kMinPriority && priority.density <= kMaxPriority)) {
    return absl::InvalidArgumentError(absl::StrCat("density: priority ", priority.density, " of object `",
                                                   priority.node, "`; it must be ", kMinPriority, " to ",
                                                   kMaxPriority));
  }
  if (!priority.node.empty() &&
      std::ranges::find(scene.nodes, priority.node, &scene::Node::name) != scene.nodes.end())
    return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("density: no node of the scene is called `", priority.node, "`"));
}

}  // namespace

double eccentricity(std::span<const dvec3> corners, const GazeRay& ray) {
  assert(corners.size() <= kMaxPatchCorners);
  std::array<dvec3, kMaxPatchCorners> directions;
  dvec3 center(0);
  for (size_t i = 0; i < corners.size(); ++i) center += directions[i] = unit(corners[i] - ray.eye);
  // Squared tangent of the largest angle between the centre and a corner.
  double spread = 0;
  for (size_t i = 0; i < corners.size(); ++i) {
    const double along = glm::dot(center, directions[i]);
    if (!(along > 0)) return 0;
    const dvec3 across = glm::cross(center, directions[i]);
    spread = std::max(spread, glm::dot(across, across) / (along * along));
  }
  const dvec3 ahead = unit(ray.direction);
  const double to_center = std::atan2(glm::length(glm::cross(ahead, center)), glm::dot(ahead, center));
  const double angle = to_center - std::atan(std::sqrt(spread));
  return angle > 0 ? angle : 0;  // NaN: 0
}

double foveal_scale(double eccentricity_rad, double pixels_per_radian) {
  const double resolved_deg = kMarSlope * eccentricity_rad * kDegreesPerRadian + kFovealMarDeg;
  const double displayed_deg = 2 * kDegreesPerRadian / pixels_per_radian;
  return std::min(1.0, displayed_deg / resolved_deg);
}

double barrel_scale(double n) {
  n = std::min(n, kBarrelRange);
  if (!(n > 0)) return 1;
  return std::min(1.0, 5.4e-4 / n + 0.98 + n * (0.13 + n * (-0.56 + n * (0.32 - n * 0.06))));
}

Status Density::check(const scene::Scene& scene, const DensitySettings& settings) {
  for (const ObjectPriority& priority : settings.priorities)
    TESSERA_RETURN_IF_ERROR(check_priority(scene, priority));
  return absl::OkStatus();
}

StatusOr<std::unique_ptr<Density>> Density::create(const scene::Scene& scene, const DensitySettings& settings,
                                                   const DensityDisplay& display) {
  TESSERA_RETURN_IF_ERROR(check(scene, settings));
  std::unique_ptr<Density> density(new Density(scene, settings, display));
  if (settings.priorities.empty()) return density;
  for (const scene::Instance& instance : scene.instances) {
    const ObjectPriority* priority = priority_of(scene, instance.node, settings.priorities);
    density->length_factor_.push_back(priority ? std::sqrt(priority->density) : 1.0f);
  }
  return density;
}

// What the eye cannot resolve the display need not show, and the other way round: the weaker of the two
// decides.
double Density::needed_by(std::span<const dvec3> corners, const Viewers& viewers) const {
  double scale = 1;
  if (settings_.foveated)
    scale = foveal_scale(smallest_eccentricity(corners, viewers.gazes), display_.pixels_per_radian);
  if (settings_.barrel)
    scale =
        std::min(scale, barrel_scale(smallest_eccentricity(corners, viewers.axes) / display_.half_field_rad));
  return scale;
}

void Density::scale(std::span<const dmat4> instance_transforms, const Viewers& viewers,
                    scene::VisiblePatches& visible) const {
  const bool looks = settings_.foveated || settings_.barrel;
  size_t i = 0;  // the instance of the last patch: both are sorted
  for (scene::VisiblePatch& v : visible) {
    while (i + 1 < scene_.instances.size() && scene_.instances[i + 1].first_patch <= v.patch) ++i;
    const scene::Instance& instance = scene_.instances[i];
    double factor = length_factor_.empty() ? 1 : length_factor_[i];
    if (looks) {
      const scene::Geometry& geometry = scene_.geometries[instance.geometry];
      const scene::Patch& patch = geometry.patches[v.patch - instance.first_patch];
      factor *= needed_by(corners_of(geometry, patch, instance_transforms[i]).span(), viewers);
    }
    if (factor == 1) continue;
    v.footprint.u_px *= static_cast<float>(factor);
    v.footprint.v_px *= static_cast<float>(factor);
    v.footprint.area_px2 *= static_cast<float>(factor * factor);
  }
}

}  // namespace tessera::atlas
