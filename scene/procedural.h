// Scenes made by the program itself, for the demo and the tests.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/camera_path.h"
#include "base/status.h"
#include "scene/scene.h"

namespace tessera::scene {

// A hall with columns, thin pipes and railings (slanted triangles), moving rigid parts, a fence and leaves
// with alpha masks, and many lights. `detail` in 0..2 scales the triangle count (about 5k, 30k, 200k).
// Procedural textures.
std::shared_ptr<Scene> make_gallery(int detail = 1);
// A walk through the gallery with head turns, 60 poses a second.
CameraPath gallery_path();

// Blocks of instanced houses; at least `triangles` instanced triangles.
std::shared_ptr<Scene> make_city(uint64_t triangles);
CameraPath city_path();

// A pipe of few slanted triangles before a wall, and a sway beside it.
std::shared_ptr<Scene> make_pipe();
CameraPath pipe_path();

// `spec` is a glTF file's path, or `gallery[:detail]`, or `city[:triangles]`, or `pipe`.
StatusOr<std::shared_ptr<Scene>> load_scene(const std::string& spec);
bool is_procedural(const std::string& spec);  // not a file
// `spec` is a CSV file's path, or `gallery`, or `city`, or `pipe`. Its time counts from its first pose.
StatusOr<CameraPath> load_path(const std::string& spec);

}  // namespace tessera::scene
