// Whole files at once.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>
#include <vector>

#include "base/status.h"

namespace tessera::bench {

StatusOr<std::vector<uint8_t>> read_file(const std::filesystem::path& file);

// Written under another name first and renamed, so that a reader never sees half a file. Missing folders are
// made.
Status write_file(const std::filesystem::path& file, std::span<const uint8_t> bytes);
Status write_file(const std::filesystem::path& file, std::string_view text);

// A stable fingerprint of bytes (FNV-1a, 64 bit) for names of files; not for security.
uint64_t fingerprint(std::string_view bytes);
// The same as 16 hexadecimal digits.
std::string fingerprint_hex(std::string_view bytes);

}  // namespace tessera::bench
