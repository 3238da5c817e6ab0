// Node transforms over time. glTF 2.0 specification, appendix C (animation sampler interpolation).
#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "scene/scene.h"

namespace tessera::scene {
namespace {

using glm::dvec4;

struct Trs {
  dvec3 translation;
  dquat rotation;
  dvec3 scale;
};

dmat4 to_matrix(const Trs& trs) {
  dmat4 m = glm::mat4_cast(trs.rotation);
  for (int axis = 0; axis < 3; ++axis) m[axis] *= trs.scale[axis];
  m[3] = dvec4(trs.translation, 1.0);
  return m;
}

dquat to_quat(const dvec4& xyzw) {
  const dquat q(xyzw.w, xyzw.x, xyzw.y, xyzw.z);
  const double length = glm::length(q);
  return length > 0 ? q / length : dquat(1, 0, 0, 0);
}

dvec4 from_quat(const dquat& q) {
  return dvec4(q.x, q.y, q.z, q.w);
}

dvec4 key_value(const AnimationChannel& channel, size_t key) {
  const size_t step = channel.interpolation == Interpolation::cubic_spline ? 3 : 1;
  return dvec4(channel.values[key * step + (step == 3 ? 1 : 0)]);
}

// Cubic Hermite between keys `k` and `k + 1`; tangents are per second, so they are scaled by the span.
dvec4 cubic(const AnimationChannel& channel, size_t k, double t, double span_s) {
  const dvec4 v0(channel.values[3 * k + 1]), out(channel.values[3 * k + 2]);
  const dvec4 in(channel.values[3 * k + 3]), v1(channel.values[3 * k + 4]);
  const double t2 = t * t, t3 = t2 * t;
  return (2 * t3 - 3 * t2 + 1) * v0 + span_s * (t3 - 2 * t2 + t) * out + (3 * t2 - 2 * t3) * v1 +
         span_s * (t3 - t2) * in;
}

// Before the first and after the last key the channel stands still.
dvec4 sample(const AnimationChannel& channel, double time_s) {
  const std::vector<double>& times = channel.times_s;
  const auto after = std::upper_bound(times.begin(), times.end(), time_s);
  if (after == times.begin()) return key_value(channel, 0);
  const size_t k = static_cast<size_t>(after - times.begin()) - 1;
  if (after == times.end() || channel.interpolation == Interpolation::step) return key_value(channel, k);
  const double span_s = times[k + 1] - times[k];
  const double t = (time_s - times[k]) / span_s;
  if (channel.interpolation == Interpolation::cubic_spline) return cubic(channel, k, t, span_s);
  const dvec4 a = key_value(channel, k), b = key_value(channel, k + 1);
  // glm::slerp takes the shorter arc and falls back to a blend for nearly equal rotations.
  if (channel.path == AnimationPath::rotation) return from_quat(glm::slerp(to_quat(a), to_quat(b), t));
  return a + t * (b - a);
}

void apply(const AnimationChannel& channel, double time_s, Trs& trs) {
  const dvec4 value = sample(channel, time_s);
  switch (channel.path) {
    case AnimationPath::translation:
      trs.translation = dvec3(value);
      break;
    case AnimationPath::rotation:
      trs.rotation = to_quat(value);
      break;
    case AnimationPath::scale:
      trs.scale = dvec3(value);
      break;
  }
}

// The remainder is taken in integer nanoseconds, so that a scene runs equally smoothly after days.
double looped_seconds(TimeNs time_ns, double length_s) {
  const DurationNs length_ns = from_seconds(length_s);
  if (length_ns <= 0) return 0;
  const DurationNs rest = time_ns % length_ns;
  return to_seconds(rest < 0 ? rest + length_ns : rest);
}

}  // namespace

std::vector<dmat4> Scene::node_transforms(TimeNs time_ns) const {
  const double time_s = looped_seconds(time_ns, animation_length_s);
  std::unordered_map<uint32_t, Trs> posed;
  for (const AnimationChannel& channel : animations) {
    if (channel.times_s.empty()) continue;
    const Node& node = nodes[channel.node];
    apply(channel, time_s,
          posed.try_emplace(channel.node, Trs{node.translation, node.rotation, node.scale}).first->second);
  }
  std::vector<dmat4> worlds(nodes.size());
  for (uint32_t i = 0; i < nodes.size(); ++i) {
    const Node& node = nodes[i];
    const auto pose = posed.find(i);
    const dmat4 local = pose != posed.end() ? to_matrix(pose->second)
                        : node.matrix       ? *node.matrix
                                            : to_matrix({node.translation, node.rotation, node.scale});
    worlds[i] = node.parent == kNone ? local : worlds[node.parent] * local;
  }
  return worlds;
}

}  // namespace tessera::scene
