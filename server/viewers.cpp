#include "server/viewers.h"

#include <algorithm>
#include <cmath>

namespace tessera::server {
namespace {

constexpr dvec3 kAhead(0, 0, -1);

float widest_half_angle(const Fov& fov) {
  const auto angle = [](float tangent) { return std::atan(std::abs(tangent)); };
  return std::max({angle(fov.left), angle(fov.right), angle(fov.down), angle(fov.up)});
}

// A head at rest is predicted to stay where it is.
void add(std::vector<atlas::GazeRay>& rays, const atlas::GazeRay& ray) {
  if (std::ranges::find(rays, ray) == rays.end()) rays.push_back(ray);
}

}  // namespace

std::vector<Eye> eyes_of(const SessionSettings& settings) {
  if (!settings.eyes.empty()) return settings.eyes;
  return {{.fov = settings.client_view.fov}};
}

View finest_view(const View& client_view, std::span<const Eye> eyes) {
  View finest = client_view;
  finest.fov = eyes.front().fov;
  for (const Eye& eye : eyes) {
    View other = client_view;
    other.fov = eye.fov;
    if (other.pixels_per_radian() > finest.pixels_per_radian()) finest = other;
  }
  return finest;
}

atlas::DensityDisplay display_of(const View& finest, std::span<const Eye> eyes) {
  atlas::DensityDisplay display{.pixels_per_radian = finest.pixels_per_radian()};
  for (const Eye& eye : eyes)
    display.half_field_rad = std::max(display.half_field_rad, widest_half_angle(eye.fov));
  return display;
}

atlas::Viewers viewers_of(std::span<const View> views, std::span<const View> heads,
                          const std::optional<vec3>& gaze) {
  const dvec3 looks = gaze ? dvec3(*gaze) : kAhead;
  atlas::Viewers viewers;
  for (size_t i = 0; i < views.size(); ++i) {
    const Pose &eye = views[i].pose, &head = heads[i % heads.size()].pose;
    const dvec3 direction = head.orientation * looks;
    add(viewers.gazes, {head.position, direction});
    add(viewers.gazes, {eye.position, direction});
    add(viewers.axes, {eye.position, eye.orientation * kAhead});
  }
  return viewers;
}

}  // namespace tessera::server
