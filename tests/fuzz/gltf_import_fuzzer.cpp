// libFuzzer: any bytes as a glTF file. Limits are small, so that memory shows leaks and bombs rather than
// legal size.
#include <cstddef>
#include <cstdint>

#include "scene/gltf.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  tessera::scene::ImportOptions options;
  options.limits.max_file_bytes = 1 << 20;
  options.limits.max_triangles = options.limits.max_instanced_triangles = 20'000;
  options.limits.max_texture_bytes = 1 << 20;
  options.limits.max_texture_side = 512;
  options.limits.max_nodes = 10'000;
  const auto scene =
      tessera::scene::load_gltf({reinterpret_cast<const std::byte*>(data), size}, "fuzz.glb", {}, options);
  if (scene.ok()) (*scene)->world_bounds(tessera::kNsPerSecond);
  return 0;
}
