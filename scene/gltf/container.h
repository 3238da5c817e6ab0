// The outermost layer of a glTF file: GLB chunks, and limits that hold before any JSON is parsed.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "base/status.h"

namespace tessera::scene {

// `chair.glb: /accessors/3/count: …`. `path` is a JSON pointer into the file, or empty.
Status import_error(const std::string& file, const std::string& path, const std::string& what);

struct Container {
  std::string_view json;
  std::span<const uint8_t> bin;  // the GLB's binary chunk; empty in a .gltf
};

// Splits a GLB into its chunks, or takes anything else as JSON text. The views point into `bytes`.
StatusOr<Container> open_container(std::span<const std::byte> bytes, const std::string& file);

// Bounds the nesting depth and the number of values of JSON text, so that parsing it takes bounded stack and
// memory.
Status check_json_shape(std::string_view json, const std::string& file);

}  // namespace tessera::scene
