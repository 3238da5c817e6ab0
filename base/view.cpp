#include "base/view.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

bool is_finite(double v) {
  return std::isfinite(v);
}

float widen(float tangent, float by_rad) {
  constexpr float kMaxHalfAngle = 89.5f * 3.14159265f / 180.0f;
  return std::tan(std::clamp(std::atan(tangent) + by_rad, -kMaxHalfAngle, kMaxHalfAngle));
}

}  // namespace

Pose normalized(const Pose& pose) {
  Pose out = pose;
  for (int i = 0; i < 3; ++i) {
    if (!is_finite(out.position[i])) out.position[i] = 0;
  }
  const dquat& q = pose.orientation;
  // Scale first: the squares of very large or very small components would leave the range of double.
  const double largest = std::max({std::abs(q.x), std::abs(q.y), std::abs(q.z), std::abs(q.w)});
  if (!is_finite(q.x + q.y + q.z + q.w) || !(largest > 0)) {
    out.orientation = dquat(1, 0, 0, 0);
  } else {
    out.orientation = glm::normalize(q / largest);
  }
  return out;
}

Pose compose(const Pose& outer, const Pose& inner) {
  return {outer.position + outer.orientation * inner.position, outer.orientation * inner.orientation};
}

Pose interpolate(const Pose& a, const Pose& b, double t) {
  Pose out;
  out.position = a.position + (b.position - a.position) * t;
  dquat to = b.orientation;
  if (glm::dot(a.orientation, to) < 0) to = -to;
  out.orientation = glm::normalize(glm::slerp(a.orientation, to, t));
  return out;
}

Fov Fov::symmetric(float fov_y_rad, float aspect) {
  const float up = std::tan(0.5f * fov_y_rad);
  return {-up * aspect, up * aspect, -up, up};
}

Fov Fov::widened(float horizontal_rad, float vertical_rad) const {
  return {widen(left, -horizontal_rad), widen(right, horizontal_rad), widen(down, -vertical_rad),
          widen(up, vertical_rad)};
}

float Fov::width_rad() const {
  return std::atan(right) - std::atan(left);
}
float Fov::height_rad() const {
  return std::atan(up) - std::atan(down);
}

float View::pixels_per_radian() const {
  return 0.5f * (static_cast<float>(width) / (fov.right - fov.left) +
                 static_cast<float>(height) / (fov.up - fov.down));
}

mat4 projection_matrix(const Fov& fov, float near_m) {
  const float w = fov.right - fov.left, h = fov.up - fov.down;
  mat4 m(0.0f);
  m[0][0] = 2 / w;
  m[1][1] = 2 / h;
  m[2][0] = (fov.right + fov.left) / w;
  m[2][1] = (fov.up + fov.down) / h;
  m[2][3] = -1;
  m[3][2] = near_m;
  return m;
}

mat4 view_matrix(const Pose& pose, const dvec3& origin) {
  const glm::dmat3 world_to_camera = glm::mat3_cast(glm::conjugate(pose.orientation));
  const dvec3 translation = -(world_to_camera * (pose.position - origin));
  mat4 m = mat4(mat3(world_to_camera));
  m[3] = vec4(vec3(translation), 1.0f);
  return m;
}

mat4 view_projection(const View& view, const dvec3& origin) {
  return projection_matrix(view.fov, view.near_m) * view_matrix(view.pose, origin);
}

}  // namespace tessera
