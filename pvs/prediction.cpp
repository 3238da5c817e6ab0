#include "pvs/prediction.h"

#include <algorithm>
#include <cmath>

namespace tessera::pvs {
namespace {

// Longer than a pause between two poses of one motion.
constexpr DurationNs kMaxGapNs = kNsPerSecond / 2;
// Velocities are fitted over this time: one pair of poses is noisy (mice report in steps, poses are rounded).
constexpr DurationNs kFitNs = 50 * kNsPerMs;
// Faster pairs are teleports and snap turns, which say nothing about where the view goes next.
constexpr double kMaxSpeedMps = 100;
constexpr double kMaxAngularSpeed = 20;  // rad/s
// Share of the predicted rotation by which it may be wrong.
constexpr double kTurnUncertainty = 0.25;
// Margins do not push a half angle past this (a pixel's share of the field shrinks with cos²): the views
// along a fast turn cover what it sweeps.
constexpr float kMaxHalfAngleRad = 1.2217305f;  // 70 degrees

// The rotation vector (axis times angle, at most pi) from `a` to `b` in the camera axes of `b`.
dvec3 rotation_between(const dquat& a, const dquat& b) {
  dquat d = glm::conjugate(a) * b;
  if (d.w < 0) d = -d;
  const dvec3 axis(d.x, d.y, d.z);
  const double sine = glm::length(axis);
  if (sine < 1e-12) return 2.0 * axis;
  return axis * (2 * std::atan2(sine, d.w) / sine);
}

dquat rotation_by(const dvec3& vector) {
  const double angle = glm::length(vector);
  if (angle < 1e-12) return dquat(1, 0.5 * vector.x, 0.5 * vector.y, 0.5 * vector.z);
  return glm::angleAxis(angle, vector / angle);
}

struct Motion {
  dvec3 velocity{0};  // m/s
  dvec3 turn{0};      // rad/s, camera axes
};

bool is_continuous(const TimedPose& a, const TimedPose& b) {
  const DurationNs dt = b.time_ns - a.time_ns;
  if (dt <= 0 || dt > kMaxGapNs) return false;
  const double seconds = to_seconds(dt);
  return glm::distance(a.pose.position, b.pose.position) <= kMaxSpeedMps * seconds &&
         glm::length(rotation_between(a.pose.orientation, b.pose.orientation)) <= kMaxAngularSpeed * seconds;
}

// The poses, brought to unit quaternions, of the unbroken motion that ends with the newest pose; newest
// first.
std::vector<TimedPose> newest_motion(std::span<const TimedPose> history) {
  std::vector<TimedPose> out;
  for (size_t i = history.size(); i-- > 0;) {
    const TimedPose pose{history[i].time_ns, normalized(history[i].pose)};
    if (!out.empty() && !is_continuous(pose, out.back())) break;
    out.push_back(pose);
    if (out.front().time_ns - pose.time_ns > 4 * kFitNs) break;
  }
  return out;
}

// Least squares over kFitNs before poses[from], through that pose; at least one pair. Constant motion comes
// out exactly.
Motion fit(std::span<const TimedPose> poses, size_t from, size_t* last) {
  Motion sum;
  double weight = 0;
  const TimedPose& newest = poses[from];
  *last = from;
  for (size_t i = from + 1; i < poses.size(); ++i) {
    const DurationNs age = newest.time_ns - poses[i].time_ns;
    if (i > from + 1 && age > kFitNs) break;
    const double dt = to_seconds(age);
    sum.velocity += dt * (newest.pose.position - poses[i].pose.position);
    sum.turn += dt * rotation_between(poses[i].pose.orientation, newest.pose.orientation);
    weight += dt * dt;
    *last = i;
  }
  if (weight > 0) {
    sum.velocity /= weight;
    sum.turn /= weight;
  }
  return sum;
}

struct Prediction {
  TimedPose newest;
  Motion motion;
  dvec3 turn_change{0};  // |angular acceleration| by camera axis, rad/s²
};

Prediction predict(std::span<const TimedPose> history, TimeNs now_ns) {
  const std::vector<TimedPose> poses = newest_motion(history);
  Prediction out{.newest = poses.front()};
  const DurationNs age = now_ns - out.newest.time_ns;
  if (poses.size() < 2 || age < 0 || age > kMaxGapNs) return out;
  size_t middle = 0, last = 0;
  out.motion = fit(poses, 0, &middle);
  if (middle + 1 < poses.size()) {
    const Motion before = fit(poses, middle, &last);
    const double between =
        0.5 * to_seconds(poses[0].time_ns - poses[last].time_ns);  // the middles of the two fits
    out.turn_change = glm::abs(out.motion.turn - before.turn) / between;
  }
  return out;
}

// Widens one side of the field by the margin, but not past kMaxHalfAngleRad.
float allowed(float margin, float half_angle) {
  return std::clamp(kMaxHalfAngleRad - half_angle, 0.0f, margin);
}

// One side of the view moves out by whole pixels, at least to `to`: where the client does not move, pixel
// centres stay where the client has them, so that slivers that its pixels hit are hit here too.
uint32_t grow_side(float& side, float to, float pixel) {
  const float pixels = std::max(0.0f, std::ceil(std::abs(to - side) / pixel - 0.01f));
  side += (to < side ? -pixels : pixels) * pixel;
  return static_cast<uint32_t>(pixels);
}

View grown(const View& client, const Fov& to) {
  const float pixel_x = (client.fov.right - client.fov.left) / static_cast<float>(client.width);
  const float pixel_y = (client.fov.up - client.fov.down) / static_cast<float>(client.height);
  View view = client;
  view.width += grow_side(view.fov.left, to.left, pixel_x) + grow_side(view.fov.right, to.right, pixel_x);
  view.height += grow_side(view.fov.down, to.down, pixel_y) + grow_side(view.fov.up, to.up, pixel_y);
  return view;
}

// Views that follow each other look through different points of their pixels, the first through the centres
// and the others through the usual samples of 4x multisampling: together they see the slivers that a client's
// samples hit.
void shift_samples(View& view, size_t index) {
  static constexpr float kSamples[5][2] = {
      {0, 0}, {-.125f, -.375f}, {.375f, -.125f}, {-.375f, .125f}, {.125f, .375f}};
  const float* sample = kSamples[index % 5];
  const float x = sample[0] * (view.fov.right - view.fov.left) / static_cast<float>(view.width);
  const float y = sample[1] * (view.fov.up - view.fov.down) / static_cast<float>(view.height);
  view.fov = {view.fov.left + x, view.fov.right + x, view.fov.down - y, view.fov.up - y};
}

View with_margin(const View& client, const Prediction& prediction, double ahead_s,
                 const PredictionSettings& settings) {
  const float half_width = 0.5f * client.fov.width_rad(), half_height = 0.5f * client.fov.height_rad();
  const dvec3 error = kTurnUncertainty * glm::abs(prediction.motion.turn) * ahead_s +
                      0.5 * prediction.turn_change * ahead_s * ahead_s;
  // A roll moves the sides by the other axis' half field.
  const double x = settings.base_margin * half_width + error.y + error.z * half_height;
  const double y = settings.base_margin * half_height + error.x + error.z * half_width;
  const float max_margin = std::max(0.0f, settings.max_margin_rad);
  const float margin_x = std::clamp(static_cast<float>(x), 0.0f, max_margin);
  const float margin_y = std::clamp(static_cast<float>(y), 0.0f, max_margin);

  const float widest_x =
      std::max(std::abs(std::atan(client.fov.left)), std::abs(std::atan(client.fov.right)));
  const float widest_y = std::max(std::abs(std::atan(client.fov.down)), std::abs(std::atan(client.fov.up)));
  return grown(client, client.fov.widened(allowed(margin_x, widest_x), allowed(margin_y, widest_y)));
}

View view_at(const View& client, const Prediction& prediction, double ahead_s,
             const PredictionSettings& settings) {
  View view = with_margin(client, prediction, ahead_s, settings);
  view.pose.position = prediction.newest.pose.position + prediction.motion.velocity * ahead_s;
  view.pose.orientation =
      glm::normalize(prediction.newest.pose.orientation * rotation_by(prediction.motion.turn * ahead_s));
  return view;
}

}  // namespace

// Every step, and always the horizon.
std::vector<DurationNs> prediction_times(const PredictionSettings& settings) {
  std::vector<DurationNs> out{0};
  if (settings.mode == PredictionMode::none) return out;
  const DurationNs horizon = std::max<DurationNs>(0, settings.horizon_ns);
  const DurationNs most = std::max(2u, settings.max_views) - 1;  // after the first
  const DurationNs step = std::max({settings.step_ns, (horizon + most - 1) / most, DurationNs{1}});
  // A last step shorter than a tenth of one is not worth a view.
  for (DurationNs t = step; t < horizon - step / 10; t += step) out.push_back(t);
  if (horizon > 0) out.push_back(horizon);
  return out;
}

std::vector<View> predict_views(std::span<const TimedPose> history, TimeNs now_ns, const View& client_view,
                                const PredictionSettings& settings) {
  if (settings.mode == PredictionMode::none) {
    View view = client_view;
    view.pose = normalized(history.back().pose);
    return {view};
  }
  const Prediction prediction = predict(history, now_ns);
  // A pose from before `now_ns` (it travelled) is extrapolated from its own time; a clock that jumped back
  // adds nothing.
  const DurationNs age = std::clamp<DurationNs>(now_ns - prediction.newest.time_ns, 0, kMaxGapNs);
  std::vector<View> views;
  const auto add = [&](DurationNs ahead) {
    views.push_back(view_at(client_view, prediction, to_seconds(ahead), settings));
    shift_samples(views.back(), views.size() - 1);
  };
  add(0);
  if (age > 0 && 2 * age > settings.step_ns) add(age);
  for (const DurationNs ahead : prediction_times(settings))
    if (ahead > 0) add(age + ahead);
  return views;
}

std::vector<View> predict_views(std::span<const TimedPose> history, TimeNs now_ns, const View& client_view,
                                std::span<const Eye> eyes, const PredictionSettings& settings) {
  std::vector<View> views;
  for (const Eye& eye : eyes) {
    View seen = client_view;
    seen.fov = eye.fov;
    for (View& view : predict_views(history, now_ns, seen, settings)) {
      view.pose = compose(view.pose, eye.in_head);
      views.push_back(view);
    }
  }
  return views;
}

}  // namespace tessera::pvs
