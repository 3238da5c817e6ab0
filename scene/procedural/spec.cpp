// Scenes and paths by name: what the programs' --scene and --path take.
#include <optional>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "scene/gltf.h"
#include "scene/procedural.h"

namespace tessera::scene {
namespace {

constexpr uint64_t kDefaultCityTriangles = 1'000'000, kMaxCityTriangles = 500'000'000;

bool names(const std::string& spec, const std::string& scene) {
  return spec == scene || absl::StartsWith(spec, scene + ":");
}

// The number behind the colon.
StatusOr<uint64_t> argument(const std::string& spec, uint64_t otherwise, uint64_t max) {
  const size_t colon = spec.find(':');
  if (colon == std::string::npos) return otherwise;
  uint64_t value;
  if (!absl::SimpleAtoi(spec.substr(colon + 1), &value) || value > max) {
    return absl::InvalidArgumentError(
        absl::StrFormat("scene \"%s\": expected a number from 0 to %d after the colon", spec, max));
  }
  return value;
}

}  // namespace

bool is_procedural(const std::string& spec) {
  return names(spec, "gallery") || names(spec, "city") || spec == "pipe";
}

StatusOr<std::shared_ptr<Scene>> load_scene(const std::string& spec) {
  if (names(spec, "gallery")) {
    TESSERA_ASSIGN_OR_RETURN(const uint64_t detail, argument(spec, 1, 2));
    return make_gallery(static_cast<int>(detail));
  }
  if (names(spec, "city")) {
    TESSERA_ASSIGN_OR_RETURN(const uint64_t triangles,
                             argument(spec, kDefaultCityTriangles, kMaxCityTriangles));
    return make_city(triangles);
  }
  if (spec == "pipe") return make_pipe();
  return load_gltf(std::filesystem::path(spec));
}

StatusOr<CameraPath> load_path(const std::string& spec) {
  if (spec == "gallery") return gallery_path();
  if (spec == "city") return city_path();
  if (spec == "pipe") return pipe_path();
  TESSERA_ASSIGN_OR_RETURN(const CameraPath recorded, CameraPath::load(spec));
  std::vector<TimedPose> poses = recorded.poses();
  for (TimedPose& pose : poses) pose.time_ns -= recorded.poses().front().time_ns;
  return CameraPath(std::move(poses));
}

}  // namespace tessera::scene
