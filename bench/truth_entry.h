// The bytes of one cached truth picture.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "shading/reference.h"

namespace tessera::bench {

std::vector<uint8_t> pack_truth(std::string_view key, const shading::ReferenceImage& image);

// Empty if the bytes are damaged or belong to another key. Safe for arbitrary bytes.
std::optional<shading::ReferenceImage> unpack_truth(std::string_view key, std::span<const uint8_t> bytes);

}  // namespace tessera::bench
