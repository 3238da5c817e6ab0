#include "transport/wire_pose.h"

#include <cmath>

namespace tessera::transport {
namespace {

constexpr uint8_t kNoGaze = 0, kGaze = 1;

bool is_nearly_unit(double length) {
  return length >= 0.5 && length <= 2;  // false for NaN
}

vec3 read_gaze(ByteReader& in) {
  vec3 gaze;
  for (int axis = 0; axis < 3; ++axis) gaze[axis] = in.f32();
  if (!is_nearly_unit(glm::length(gaze))) in.fail();
  return glm::normalize(gaze);
}

}  // namespace

void write_orientation(const dquat& orientation, ByteWriter& out) {
  for (const double v : {orientation.x, orientation.y, orientation.z, orientation.w})
    out.f32(static_cast<float>(v));
}

dquat read_orientation(ByteReader& in) {
  dquat q;
  q.x = in.f32();
  q.y = in.f32();
  q.z = in.f32();
  q.w = in.f32();
  if (!is_nearly_unit(glm::length(q))) in.fail();
  return normalized({{}, q}).orientation;
}

void write_pose(const SequencedPose& pose, ByteWriter& out) {
  const Pose& p = pose.timed.pose;
  out.u32(pose.sequence);
  out.i64(pose.timed.time_ns);
  out.i64(pose.sent_ns);
  for (int axis = 0; axis < 3; ++axis) out.f64(p.position[axis]);
  write_orientation(p.orientation, out);
  out.u8(pose.gaze ? kGaze : kNoGaze);
  for (int axis = 0; pose.gaze && axis < 3; ++axis) out.f32((*pose.gaze)[axis]);
}

SequencedPose read_pose(ByteReader& in) {
  SequencedPose pose;
  Pose& p = pose.timed.pose;
  pose.sequence = in.u32();
  pose.timed.time_ns = in.i64();
  pose.sent_ns = in.i64();
  bool good = is_sane(pose.timed.time_ns) && is_sane(pose.sent_ns);
  for (int axis = 0; axis < 3; ++axis) {
    p.position[axis] = in.f64();
    good = good && std::abs(p.position[axis]) <= kMaxPositionM;  // false for NaN
  }
  p.orientation = read_orientation(in);
  const uint8_t gaze = in.u8();
  if (gaze == kGaze) pose.gaze = read_gaze(in);
  if (!good || gaze > kGaze) in.fail();
  return pose;
}

}  // namespace tessera::transport
