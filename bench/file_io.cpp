#include "bench/file_io.h"

#include <unistd.h>

#include <fstream>
#include <iterator>

namespace tessera::bench {

StatusOr<std::vector<uint8_t>> read_file(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) return absl::NotFoundError(absl::StrCat(file.string(), ": cannot be opened for reading"));
  std::vector<uint8_t> bytes{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  if (in.bad()) return absl::DataLossError(absl::StrCat(file.string(), ": reading failed"));
  return bytes;
}

Status write_file(const std::filesystem::path& file, std::span<const uint8_t> bytes) {
  std::error_code error;
  if (file.has_parent_path()) std::filesystem::create_directories(file.parent_path(), error);
  const std::filesystem::path partial = file.string() + absl::StrCat(".", getpid(), ".part");
  std::ofstream out(partial, std::ios::binary);
  out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  out.close();
  if (out) std::filesystem::rename(partial, file, error);
  if (!out || error) {
    std::error_code ignored;
    std::filesystem::remove(partial, ignored);
    return absl::UnavailableError(
        absl::StrCat(file.string(), ": cannot be written; check the folder and free space"));
  }
  return absl::OkStatus();
}

Status write_file(const std::filesystem::path& file, std::string_view text) {
  return write_file(file, std::span(reinterpret_cast<const uint8_t*>(text.data()), text.size()));
}

uint64_t fingerprint(std::string_view bytes) {
  uint64_t hash = 0xcbf29ce484222325;
  for (const char c : bytes) hash = (hash ^ static_cast<uint8_t>(c)) * 0x100000001b3;
  return hash;
}

std::string fingerprint_hex(std::string_view bytes) {
  return absl::StrFormat("%016x", fingerprint(bytes));
}

}  // namespace tessera::bench
