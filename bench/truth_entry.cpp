#include "bench/truth_entry.h"

#include <zlib.h>

#include <cstring>
#include <string>

#include "bench/image_io.h"

namespace tessera::bench {
namespace {

// Layout: magic, CRC-32 of all that follows, then five sections (key, PNG, ids, covered, depth), each led by
// its stored size and, for the deflated ones, its full size. Host byte order: a cache never leaves its
// machine.
constexpr char kMagic[8] = {'T', 'E', 'S', 'S', 'T', 'R', 'U', '1'};
constexpr size_t kHeaderBytes = sizeof kMagic + sizeof(uint32_t);

class Writer {
 public:
  void section(std::span<const uint8_t> bytes) {
    number(bytes.size());
    out_.insert(out_.end(), bytes.begin(), bytes.end());
  }
  template <class T>
  void deflated(const std::vector<T>& values) {
    const uLong size = values.size() * sizeof(T);
    std::vector<uint8_t> packed(compressBound(size));
    uLongf packed_size = packed.size();
    compress2(packed.data(), &packed_size, reinterpret_cast<const Bytef*>(values.data()), size, Z_BEST_SPEED);
    number(size);
    section(std::span(packed.data(), packed_size));
  }
  std::vector<uint8_t> finish() && {
    const auto crc = static_cast<uint32_t>(crc32_z(0, out_.data(), out_.size()));
    std::vector<uint8_t> file(kHeaderBytes + out_.size());
    std::memcpy(file.data(), kMagic, sizeof kMagic);
    std::memcpy(file.data() + sizeof kMagic, &crc, sizeof crc);
    std::memcpy(file.data() + kHeaderBytes, out_.data(), out_.size());
    return file;
  }

 private:
  void number(uint64_t n) {
    const auto* bytes = reinterpret_cast<const uint8_t*>(&n);
    out_.insert(out_.end(), bytes, bytes + sizeof n);
  }
  std::vector<uint8_t> out_;
};

// Latches its first error; test ok() once at the end.
class Reader {
 public:
  explicit Reader(std::span<const uint8_t> bytes) : rest_(bytes) {}
  std::span<const uint8_t> section() {
    const uint64_t size = number();
    return take(size);
  }
  // `count` values, or none.
  template <class T>
  std::vector<T> inflated(size_t count) {
    const uint64_t size = number();
    const std::span<const uint8_t> packed = section();
    ok_ = ok_ && (size == 0 || size == count * sizeof(T));
    if (!ok_ || size == 0) return {};
    std::vector<T> values(count);
    uLongf length = size;
    ok_ =
        uncompress(reinterpret_cast<Bytef*>(values.data()), &length, packed.data(), packed.size()) == Z_OK &&
        length == size;
    return values;
  }
  bool ok() const { return ok_; }

 private:
  uint64_t number() {
    uint64_t n = 0;
    const std::span<const uint8_t> bytes = take(sizeof n);
    if (ok_) std::memcpy(&n, bytes.data(), sizeof n);
    return n;
  }
  std::span<const uint8_t> take(uint64_t size) {
    ok_ = ok_ && size <= rest_.size();
    if (!ok_) return {};
    const auto taken = rest_.first(size);
    rest_ = rest_.subspan(size);
    return taken;
  }
  std::span<const uint8_t> rest_;
  bool ok_ = true;
};

std::span<const uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

bool is_intact(std::span<const uint8_t> file) {
  if (file.size() < kHeaderBytes || std::memcmp(file.data(), kMagic, sizeof kMagic) != 0) return false;
  uint32_t crc;
  std::memcpy(&crc, file.data() + sizeof kMagic, sizeof crc);
  return crc == crc32_z(0, file.data() + kHeaderBytes, file.size() - kHeaderBytes);
}

}  // namespace

std::vector<uint8_t> pack_truth(std::string_view key, const shading::ReferenceImage& image) {
  Writer writer;
  writer.section(bytes_of(key));
  writer.section(encode_png(image.color));
  writer.deflated(image.triangle_plus_one);
  writer.deflated(image.covered);
  writer.deflated(image.depth);
  return std::move(writer).finish();
}

std::optional<shading::ReferenceImage> unpack_truth(std::string_view key, std::span<const uint8_t> bytes) {
  if (!is_intact(bytes)) return std::nullopt;
  Reader reader(bytes.subspan(kHeaderBytes));
  const std::span<const uint8_t> stored_key = reader.section();
  if (std::string_view(reinterpret_cast<const char*>(stored_key.data()), stored_key.size()) != key)
    return std::nullopt;
  auto color = decode_png(reader.section(), "cached truth");
  if (!color.ok()) return std::nullopt;

  shading::ReferenceImage image;
  image.color = *std::move(color);
  const size_t pixels = size_t{image.color.width} * image.color.height;
  image.triangle_plus_one = reader.inflated<uint32_t>(pixels);
  image.covered = reader.inflated<uint8_t>(pixels);
  image.depth = reader.inflated<float>(pixels);
  if (!reader.ok()) return std::nullopt;
  return image;
}

}  // namespace tessera::bench
