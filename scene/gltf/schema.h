// What the JSON of a glTF file must look like: types, ranges, required fields, and references that exist.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "base/status.h"
#include "scene/gltf.h"

namespace tessera::scene {

// Extensions that the import understands.
bool is_known_extension(std::string_view name);

// Checks every field that the import uses against the table in schema.cpp. After it, each of them has its
// type and range, and each index refers to an element that exists.
Status check_schema(const nlohmann::json& document, const std::string& file, const ImportLimits& limits);

// Removes what the import does not use (extras, unknown extensions, skins, cameras, morph targets …), so that
// nothing unchecked reaches the parser. Says in `notes` what a viewer of the scene would miss.
void strip_unused(nlohmann::json& document, std::vector<std::string>& notes);

}  // namespace tessera::scene
