#include "scene/gltf/container.h"

#include <cstring>

namespace tessera::scene {
namespace {

constexpr uint32_t kMagic = 0x46546C67, kJsonChunk = 0x4E4F534A, kBinChunk = 0x004E4942;
constexpr size_t kHeaderBytes = 12, kChunkHeaderBytes = 8;
constexpr int kMaxDepth = 64;
constexpr uint64_t kMaxValues = 20'000'000;

// All header fields are little-endian, as are the machines that we build for.
uint32_t read_u32(std::span<const std::byte> bytes, size_t offset) {
  uint32_t value;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

// The payload of the chunk at `offset`, which moves behind it.
StatusOr<std::span<const std::byte>> read_chunk(std::span<const std::byte> bytes, size_t& offset,
                                                uint32_t type, const std::string& file) {
  if (bytes.size() - offset < kChunkHeaderBytes) {
    return import_error(file, "", absl::StrFormat("the file ends within a chunk header at byte %d", offset));
  }
  const uint32_t length = read_u32(bytes, offset);
  if (read_u32(bytes, offset + 4) != type) {
    return import_error(file, "",
                        absl::StrFormat("chunk at byte %d is of type 0x%08x, expected 0x%08x", offset,
                                        read_u32(bytes, offset + 4), type));
  }
  offset += kChunkHeaderBytes;
  if (length > bytes.size() - offset) {
    return import_error(file, "",
                        absl::StrFormat("chunk of %d bytes at byte %d reaches past the file's end (%d bytes)",
                                        length, offset, bytes.size()));
  }
  const auto payload = bytes.subspan(offset, length);
  offset += length;
  return payload;
}

std::string_view as_text(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace

Status import_error(const std::string& file, const std::string& path, const std::string& what) {
  return absl::InvalidArgumentError(path.empty() ? absl::StrCat(file, ": ", what)
                                                 : absl::StrCat(file, ": ", path, ": ", what));
}

StatusOr<Container> open_container(std::span<const std::byte> bytes, const std::string& file) {
  if (bytes.size() < 4 || read_u32(bytes, 0) != kMagic) return Container{as_text(bytes), {}};
  if (bytes.size() < kHeaderBytes) return import_error(file, "", "the file ends within the GLB header");
  if (read_u32(bytes, 4) != 2) {
    return import_error(file, "", absl::StrFormat("GLB version %d, expected 2", read_u32(bytes, 4)));
  }
  const uint32_t length = read_u32(bytes, 8);
  if (length > bytes.size() || length < kHeaderBytes) {
    return import_error(
        file, "", absl::StrFormat("the GLB header says %d bytes, the file has %d", length, bytes.size()));
  }
  bytes = bytes.first(length);
  size_t offset = kHeaderBytes;
  TESSERA_ASSIGN_OR_RETURN(const std::span<const std::byte> json,
                           read_chunk(bytes, offset, kJsonChunk, file));
  Container container{as_text(json), {}};
  if (offset < bytes.size()) {
    TESSERA_ASSIGN_OR_RETURN(const std::span<const std::byte> bin,
                             read_chunk(bytes, offset, kBinChunk, file));
    container.bin = {reinterpret_cast<const uint8_t*>(bin.data()), bin.size()};
  }
  return container;
}

Status check_json_shape(std::string_view json, const std::string& file) {
  int depth = 0;
  uint64_t values = 1;
  bool in_string = false;
  for (size_t i = 0; i < json.size(); ++i) {
    const char c = json[i];
    if (in_string) {
      if (c == '\\') ++i;
      in_string = c != '"';
      continue;
    }
    in_string = c == '"';
    depth += (c == '[' || c == '{') - (c == ']' || c == '}');
    values += c == ',' || c == '[' || c == '{';
    if (depth > kMaxDepth) {
      return import_error(file, "",
                          absl::StrFormat("JSON is nested deeper than %d levels at byte %d", kMaxDepth, i));
    }
    if (values > kMaxValues) {
      return import_error(file, "", absl::StrFormat("JSON holds more than %d values", kMaxValues));
    }
  }
  return absl::OkStatus();
}

}  // namespace tessera::scene
