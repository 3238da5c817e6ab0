#include <algorithm>
#include <cmath>

#include "scene/gltf/accessor.h"
#include "scene/gltf/import.h"

namespace tessera::scene {
namespace {

constexpr double kMaxSeconds = 1e6;        // keeps nanoseconds exact in double
constexpr uint64_t kMaxKeys = 50'000'000;  // over all channels: accessors may be shared, their copies are not

bool is_finite(const vec4& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z) && std::isfinite(v.w);
}

StatusOr<std::vector<double>> read_times(const Document& document, int accessor) {
  const std::string path = absl::StrCat("/accessors/", accessor);
  const AccessorView view(document, accessor);
  if (view.components() != 1)
    return document.error(path + "/type", "the times of an animation must be scalars");
  std::vector<double> times;
  for (size_t i = 0; i < view.count(); ++i) {
    const double t = view.read(i).x;
    if (!std::isfinite(t) || t < 0 || t > kMaxSeconds) {
      return document.error(path, absl::StrFormat("time %d is not between 0 and %g s", i, kMaxSeconds));
    }
    if (!times.empty() && t <= times.back())
      return document.error(path, absl::StrFormat("time %d does not increase", i));
    times.push_back(t);
  }
  return times;
}

StatusOr<std::vector<vec4>> read_values(const Document& document, int accessor,
                                        const AnimationChannel& channel) {
  const std::string path = absl::StrCat("/accessors/", accessor);
  const AccessorView view(document, accessor);
  const int components = channel.path == AnimationPath::rotation ? 4 : 3;
  if (view.components() != components) {
    return document.error(path + "/type", absl::StrFormat("has %d components, the animation needs %d",
                                                          view.components(), components));
  }
  const size_t expected =
      channel.times_s.size() * (channel.interpolation == Interpolation::cubic_spline ? 3 : 1);
  if (view.count() != expected) {
    return document.error(
        path + "/count", absl::StrFormat("%d values, the animation's times need %d", view.count(), expected));
  }
  std::vector<vec4> values;
  for (size_t i = 0; i < view.count(); ++i) {
    values.push_back(view.read(i));
    if (!is_finite(values.back()))
      return document.error(path, absl::StrFormat("element %d is not finite", i));
  }
  return values;
}

StatusOr<AnimationChannel> read_channel(const Document& document, const tinygltf::Animation& animation,
                                        const tinygltf::AnimationChannel& source, const std::string& path) {
  if (source.sampler < 0 || static_cast<size_t>(source.sampler) >= animation.samplers.size()) {
    return document.error(path + "/sampler",
                          absl::StrFormat("%d does not exist: the animation has %d samplers", source.sampler,
                                          animation.samplers.size()));
  }
  const tinygltf::AnimationSampler& sampler = animation.samplers[static_cast<size_t>(source.sampler)];
  AnimationChannel channel{};
  channel.path = source.target_path == "translation" ? AnimationPath::translation
                 : source.target_path == "rotation"  ? AnimationPath::rotation
                                                     : AnimationPath::scale;
  channel.interpolation = sampler.interpolation == "STEP"          ? Interpolation::step
                          : sampler.interpolation == "CUBICSPLINE" ? Interpolation::cubic_spline
                                                                   : Interpolation::linear;
  TESSERA_ASSIGN_OR_RETURN(channel.times_s, read_times(document, sampler.input));
  TESSERA_ASSIGN_OR_RETURN(channel.values, read_values(document, sampler.output, channel));
  return channel;
}

}  // namespace

Status import_animations(const Document& document, const std::vector<uint32_t>& node_of, Scene& scene) {
  const tinygltf::Model& model = document.model();
  uint64_t keys = 0;
  for (size_t a = 0; a < model.animations.size(); ++a) {
    const tinygltf::Animation& animation = model.animations[a];
    for (size_t c = 0; c < animation.channels.size(); ++c) {
      const tinygltf::AnimationChannel& source = animation.channels[c];
      const std::string path = absl::StrFormat("/animations/%d/channels/%d", a, c);
      if (source.target_path == "weights" || node_of[static_cast<size_t>(source.target_node)] == kNone)
        continue;
      TESSERA_ASSIGN_OR_RETURN(AnimationChannel channel, read_channel(document, animation, source, path));
      channel.node = node_of[static_cast<size_t>(source.target_node)];
      if (scene.nodes[channel.node].matrix) {
        return document.error(path + "/target/node", "an animated node must not have a matrix");
      }
      keys += channel.times_s.size();
      if (keys > kMaxKeys)
        return document.over_limit(path, absl::StrFormat("more than %d animation keys", kMaxKeys));
      scene.animation_length_s = std::max(scene.animation_length_s, channel.times_s.back());
      scene.animations.push_back(std::move(channel));
    }
  }
  mark_moving_nodes(scene);
  return absl::OkStatus();
}

}  // namespace tessera::scene
