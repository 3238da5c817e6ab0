// glTF 2.0 import (.gltf, .glb). Input is hostile: everything is checked before use, memory is bounded, and
// every error names the file and the JSON path, e.g. `chair.glb: /accessors/3/count: …`.
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "base/status.h"
#include "scene/scene.h"

namespace tessera::scene {

struct ImportLimits {
  uint64_t max_file_bytes = uint64_t{2} << 30;
  uint64_t max_triangles = 50'000'000;  // unique
  uint64_t max_instanced_triangles = 500'000'000;
  uint64_t max_texture_bytes = uint64_t{4} << 30;  // decoded, all textures
  uint32_t max_texture_side = 16384;
  uint32_t max_nodes = 1'000'000;
};

struct ImportOptions {
  ImportLimits limits;
  // Triangles with long edges are split (edges at their midpoints, so neighbours stay joined): one block
  // could not carry a wall. 0 = as small as a growth of the scene by 15 % or 100,000 triangles allows; < 0 =
  // never.
  float max_edge_m = 0;
};

// What a file's import skipped or changed, for people: unsupported extensions, BLEND drawn opaque, split
// triangles …
struct ImportNotes {
  std::vector<std::string> notes;
};

StatusOr<std::shared_ptr<Scene>> load_gltf(const std::filesystem::path& file,
                                           const ImportOptions& options = {}, ImportNotes* notes = nullptr);
// The same from memory, for tests and fuzzing. `name` stands for the file in messages; external buffers and
// images are looked up relative to `base_dir`, and refused if it is empty.
StatusOr<std::shared_ptr<Scene>> load_gltf(std::span<const std::byte> bytes, const std::string& name,
                                           const std::filesystem::path& base_dir,
                                           const ImportOptions& options = {}, ImportNotes* notes = nullptr);

}  // namespace tessera::scene
