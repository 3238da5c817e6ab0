// A pipe of few long triangles before a wall (TSS fig. 15): slanted surfaces with detail all along.
#include <cmath>

#include "scene/procedural.h"
#include "scene/procedural/builder.h"
#include "scene/procedural/shapes.h"

namespace tessera::scene {
namespace {

constexpr float kLength = 8, kRadius = 0.15f;  // metres; the pipe lies along x
constexpr uint32_t kSides = 10;
constexpr float kHeight = 1.4f;  // of the pipe

}  // namespace

std::shared_ptr<Scene> make_pipe() {
  SceneBuilder build("pipe");
  SourceMesh pipe, wall, floor;
  add_surface(pipe, kSides, 1, vec2(1, kLength), [](float u, float v) {
    return vec3(kLength * (v - 0.5f), kHeight + kRadius * std::sin(kTau * u), kRadius * std::cos(kTau * u));
  });
  add_quad(wall, vec3(-kLength, 0, -1), vec3(2 * kLength, 0, 0), vec3(0, 4, 0));
  add_quad(floor, vec3(-kLength, 0, 3), vec3(2 * kLength, 0, 0), vec3(0, 0, -4));
  build.add("pipe", std::move(pipe), build.add_material("bricks", brick()));
  build.add("wall", std::move(wall), build.add_material("plaster", plaster()));
  build.add("floor", std::move(floor), build.add_material("marble", marble_tiles()));
  build.add_light({LightType::directional, vec3(1, 0.96f, 0.9f), 3}, dvec3(0), dvec3(0.3, -0.8, -0.5));
  return build.finish(0);
}

CameraPath pipe_path() {
  constexpr double kSeconds = 24, kRate = 60, kTauD = 6.283185307179586;
  std::vector<TimedPose> poses;
  for (int i = 0; i <= kSeconds * kRate; ++i) {
    const double t = i / kRate, sway = std::sin(kTauD * t / kSeconds);
    // From beside one end, looking along the pipe.
    const dvec3 position(-3.2 + 0.4 * sway, 1.65 + 0.05 * sway, 0.9);
    poses.push_back({from_seconds(t), {position, look_along(dvec3(1, -0.12, -0.45 + 0.05 * sway))}});
  }
  return CameraPath(std::move(poses));
}

}  // namespace tessera::scene
