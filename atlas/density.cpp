#include "atlas/density.h"

#include <algorithm>
#include <array>
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

// Three for each triangle, in scene coordinates.
struct Corners {
  std::array<dvec3, 9> points;
  uint32_t count = 0;
  std::span<const dvec3> span() const { return {points.data(), count}; }
};

Corners corners_of(const scene::Geometry& geometry, const scene::Patch& patch, const dmat4& transform) {
  const uint32_t* indices = geometry.indices.data() + 3 * size_t{patch.first_triangle};
  Corners corners{.count = 3 * patch.triangle_count};
  for (uint32_t i = 0; i < corners.count; ++i) {
    const dvec3 position(geometry.vertices[indices[i]].position);
    corners.points[i] = dvec3(transform * glm::dvec4(position, 1.0));
  }
  return corners;
}

// Zero or not a number where there is none.
dvec3 unit(const dvec3& v) {
  constexpr double kSmall = 1e-100, kLarge = 1e100;
  const double square = glm::dot(v, v);
  if (square > kSmall && square < kLarge) return v / std::sqrt(square);
  // Lengths near the ends of double's range square out of it.
  const double largest = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
  return largest > 0 ? glm::normalize(v / largest) : dvec3(0);
}

bool is_direction(const dvec3& v) {
  return glm::dot(v, v) > 0.5;  // false for NaN
}

// Of the points of a shape on the unit sphere that it is shown, the one closest to a direction.
class Closest {
 public:
  explicit Closest(const dvec3& to) : to_(to) {}

  void add(const dvec3& point) {
    const double cosine = glm::dot(point, to_);
    if (cosine <= cosine_) return;
    cosine_ = cosine;
    point_ = point;
  }
  // The inner points of the great circle's arc between two points, of which `normal` is the cross product.
  void add_arc(const dvec3& a, const dvec3& b, const dvec3& normal) {
    if (!(glm::dot(glm::cross(normal, a), to_) > 0 && glm::dot(glm::cross(b, normal), to_) > 0)) return;
    add(unit(to_ - normal * (glm::dot(normal, to_) / glm::dot(normal, normal))));
  }
  double angle() const { return std::atan2(glm::length(glm::cross(point_, to_)), cosine_); }

 private:
  const dvec3 to_;
  dvec3 point_{0};
  double cosine_ = -2;
};

struct Ball {
  dvec3 center{0};
  double radius = 0;
};

Ball ball_around(std::span<const dvec3> points) {
  Ball ball;
  for (const dvec3& p : points) ball.center += p / static_cast<double>(points.size());
  for (const dvec3& p : points) ball.radius = std::max(ball.radius, glm::distance(p, ball.center));
  return ball;
}

// Whether nothing in the ball is closer to the ray, whose direction has unit length, than this angle. Where
// it cannot tell, false.
bool is_beyond(const Ball& ball, const GazeRay& ray, double sine, double cosine) {
  const dvec3 to = ball.center - ray.eye;
  const double distance = glm::length(to);
  if (!(distance > ball.radius)) return false;
  const double half_sine = ball.radius / distance, half_cosine = std::sqrt(1 - half_sine * half_sine);
  const double sum_sine = sine * half_cosine + cosine * half_sine;
  const double sum_cosine = cosine * half_cosine - sine * half_sine;
  return sum_sine > 0 && glm::dot(ray.direction, to) <= sum_cosine * distance;  // false for NaN
}

// Over rays whose directions have unit length.
double smallest_eccentricity(std::span<const dvec3> triangles, std::span<const GazeRay> rays) {
  if (rays.empty()) return 0;
  const Ball ball = ball_around(triangles);
  double smallest = std::numbers::pi, sine = 0, cosine = -1;
  for (size_t i = 0; i < rays.size() && smallest > 0; ++i) {
    // From both ends of a movement inwards: then most of what lies between them need not be looked at.
    const GazeRay& ray = rays[i % 2 ? rays.size() - 1 - i / 2 : i / 2];
    if (i > 0 && is_beyond(ball, ray, sine, cosine)) continue;
    const double angle = eccentricity(triangles, ray);
    if (angle >= smallest) continue;
    smallest = angle;
    sine = std::sin(angle);
    cosine = std::cos(angle);
  }
  return smallest;
}

std::vector<GazeRay> normalized(std::span<const GazeRay> rays) {
  std::vector<GazeRay> out;
  for (const GazeRay& ray : rays) out.push_back({ray.eye, unit(ray.direction)});
  return out;
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

double eccentricity(std::span<const dvec3> triangles, const GazeRay& ray) {
  const dvec3 ahead = unit(ray.direction);
  if (!is_direction(ahead) || triangles.size() < 3) return 0;
  Closest closest(ahead);
  for (size_t t = 0; t + 2 < triangles.size(); t += 3) {
    const dvec3 a = unit(triangles[t] - ray.eye), b = unit(triangles[t + 1] - ray.eye),
                c = unit(triangles[t + 2] - ray.eye);
    if (!is_direction(a) || !is_direction(b) || !is_direction(c)) return 0;
    const dvec3 ab = glm::cross(a, b), bc = glm::cross(b, c), ca = glm::cross(c, a);
    const double side = glm::dot(ab, c);  // on which side of the triangle the eye is
    if (glm::dot(ab, ahead) * side > 0 && glm::dot(bc, ahead) * side > 0 && glm::dot(ca, ahead) * side > 0)
      return 0;  // the ray meets it
    for (const dvec3& corner : {a, b, c}) closest.add(corner);
    closest.add_arc(a, b, ab);
    closest.add_arc(b, c, bc);
    closest.add_arc(c, a, ca);
  }
  return closest.angle();
}

double foveal_scale(double eccentricity_rad, double pixels_per_radian, double foveation) {
  const double resolved_deg = kMarSlope * eccentricity_rad * kDegreesPerRadian + kFovealMarDeg;
  const double displayed_deg = 2 * kDegreesPerRadian / pixels_per_radian;
  return std::min(1.0, displayed_deg / (foveation * resolved_deg));
}

double barrel_scale(double n) {
  n = std::min(n, kBarrelRange);
  if (!(n > 0)) return 1;
  return std::min(1.0, 5.4e-4 / n + 0.98 + n * (0.13 + n * (-0.56 + n * (0.32 - n * 0.06))));
}

Status Density::check(const scene::Scene& scene, const DensitySettings& settings) {
  if (!(settings.foveation >= 0 && settings.foveation <= kMaxFoveation))
    return absl::InvalidArgumentError(
        absl::StrCat("density: a foveation of ", settings.foveation, "; it must be 0 to ", kMaxFoveation));
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
double Density::needed_by(std::span<const dvec3> triangles, const Viewers& viewers) const {
  double scale = 1;
  if (settings_.foveation > 0)
    scale = foveal_scale(smallest_eccentricity(triangles, viewers.gazes), display_.pixels_per_radian,
                         settings_.foveation);
  if (settings_.barrel)
    scale = std::min(scale,
                     barrel_scale(smallest_eccentricity(triangles, viewers.axes) / display_.half_field_rad));
  return scale;
}

void Density::scale(std::span<const dmat4> instance_transforms, const Viewers& viewers,
                    scene::VisiblePatches& visible) const {
  const bool looks = settings_.foveation > 0 || settings_.barrel;
  const Viewers unit_viewers{normalized(viewers.gazes), normalized(viewers.axes)};
  size_t i = 0;  // the instance of the last patch: both are sorted
  for (scene::VisiblePatch& v : visible) {
    while (i + 1 < scene_.instances.size() && scene_.instances[i + 1].first_patch <= v.patch) ++i;
    const scene::Instance& instance = scene_.instances[i];
    double factor = length_factor_.empty() ? 1 : length_factor_[i];
    if (looks) {
      const scene::Geometry& geometry = scene_.geometries[instance.geometry];
      const scene::Patch& patch = geometry.patches[v.patch - instance.first_patch];
      factor *= needed_by(corners_of(geometry, patch, instance_transforms[i]).span(), unit_viewers);
    }
    if (factor == 1) continue;
    v.footprint.u_px *= static_cast<float>(factor);
    v.footprint.v_px *= static_cast<float>(factor);
    v.footprint.area_px2 *= static_cast<float>(factor * factor);
  }
}

}  // namespace tessera::atlas
