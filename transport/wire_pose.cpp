#include "transport/wire_pose.h"

#include <cmath>

namespace tessera::transport {

void write_pose(const SequencedPose& pose, ByteWriter& out) {
  const Pose& p = pose.timed.pose;
  out.u32(pose.sequence);
  out.i64(pose.timed.time_ns);
  out.i64(pose.sent_ns);
  for (int axis = 0; axis < 3; ++axis) out.f64(p.position[axis]);
  for (const double v : {p.orientation.x, p.orientation.y, p.orientation.z, p.orientation.w})
    out.f32(static_cast<float>(v));
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
  p.orientation.x = in.f32();
  p.orientation.y = in.f32();
  p.orientation.z = in.f32();
  p.orientation.w = in.f32();
  const double length = glm::length(p.orientation);
  good = good && length >= 0.5 && length <= 2;
  if (!good) in.fail();
  pose.timed.pose = normalized(p);
  return pose;
}

}  // namespace tessera::transport
