// Where a camera is (Pose), what it sees (Fov) and at what resolution (View).
#pragma once

#include <cstdint>

#include "base/math.h"
#include "base/time.h"

namespace tessera {

// Camera-to-world. Metres, scene coordinates; the camera looks along its -Z with +Y up. The orientation is a
// unit quaternion; make one safe with normalized().
struct Pose {
  dvec3 position{0.0};
  dquat orientation{1.0, 0.0, 0.0, 0.0};

  bool operator==(const Pose&) const = default;
};

// A pose and the time at which it was, or will be, true.
struct TimedPose {
  TimeNs time_ns = 0;
  Pose pose;
};

// The pose with its quaternion brought to unit length. A zero or non-finite quaternion becomes the identity;
// non-finite position components become 0.
Pose normalized(const Pose& pose);

// Where something is that `inner` places within `outer`, e.g. an eye in a head.
Pose compose(const Pose& outer, const Pose& inner);

// Position: linear; orientation: slerp along the shorter arc. `t` outside [0, 1] extrapolates.
Pose interpolate(const Pose& a, const Pose& b, double t);

// An asymmetric frustum by the tangents of its four half angles; left and down are negative for a view that
// contains its axis. Fields of view from 1 to 179 degrees are supported.
struct Fov {
  float left = -1, right = 1, down = -1, up = 1;

  static Fov symmetric(float fov_y_rad, float aspect);
  // Both sides grow by these angles (radians); each half angle stays below 89.5 degrees.
  Fov widened(float horizontal_rad, float vertical_rad) const;
  float width_rad() const;   // horizontal angle
  float height_rad() const;  // vertical angle
};

// One of a viewer's eyes: where it is within the head, whose axes are a camera's, and what it sees from
// there.
struct Eye {
  Pose in_head;
  Fov fov;
};

// Everything nearer is clipped, in every pass of both ends.
constexpr float kDefaultNearM = 0.05f;

struct View {
  Pose pose;
  Fov fov;
  uint32_t width = 0, height = 0;  // pixels
  float near_m = kDefaultNearM;

  // Mean pixels per radian at the centre of the view.
  float pixels_per_radian() const;
};

// Reversed-Z with an infinite far plane: depth 1 at near_m, 0 at infinity. +Y up in clip space: Vulkan passes
// use a viewport of negative height, so the same matrix serves both graphics interfaces.
mat4 projection_matrix(const Fov& fov, float near_m);

// World-to-camera for positions that are relative to `origin` (camera-relative rendering: the subtraction is
// in double).
mat4 view_matrix(const Pose& pose, const dvec3& origin);

// projection * view, for positions relative to `origin`.
mat4 view_projection(const View& view, const dvec3& origin);

}  // namespace tessera
