#include "codec/picture_packet.h"

namespace tessera::codec {
namespace {

// An MCU has six blocks with two symbols of at least one bit each.
constexpr size_t kMinMcuBits = 12;

void append_number(uint32_t value, int bytes, std::vector<uint8_t>& out) {
  for (int shift = 8 * (bytes - 1); shift >= 0; shift -= 8)
    out.push_back(static_cast<uint8_t>(value >> shift));
}

// Seven bits a byte, the least significant first; the highest bit says that more follow.
void append_run(uint32_t value, std::vector<uint8_t>& out) {
  for (; value >= 128; value >>= 7) out.push_back(static_cast<uint8_t>(value | 128));
  out.push_back(static_cast<uint8_t>(value));
}

void append_runs(std::span<const uint32_t> mcus, uint32_t all, std::vector<uint8_t>& out) {
  uint32_t at = 0;  // everything before it is written
  for (size_t i = 0; i < mcus.size();) {
    size_t end = i + 1;
    while (end < mcus.size() && mcus[end] == mcus[end - 1] + 1) ++end;
    append_run(mcus[i] - at, out);
    append_run(static_cast<uint32_t>(end - i), out);
    at = mcus[end - 1] + 1;
    i = end;
  }
  if (at < all) append_run(all - at, out);
}

Status malformed(const char* what) {
  return absl::InvalidArgumentError(absl::StrCat("picture packet: ", what));
}

// Latches its first failure; reads zeros from then on.
class Reader {
 public:
  explicit Reader(std::span<const uint8_t> bytes) : rest_(bytes) {}

  bool ok() const { return ok_; }
  size_t remaining() const { return rest_.size(); }
  std::span<const uint8_t> bytes(size_t count) {
    if (count > rest_.size()) {
      ok_ = false;
      rest_ = {};
      return {};
    }
    const std::span<const uint8_t> taken = rest_.first(count);
    rest_ = rest_.subspan(count);
    return taken;
  }
  uint32_t number(size_t count) {
    uint32_t value = 0;
    for (const uint8_t byte : bytes(count)) value = value << 8 | byte;
    return value;
  }
  uint32_t run() {
    uint32_t value = 0;
    for (int shift = 0; shift < 28; shift += 7) {
      const uint32_t byte = number(1);
      value |= (byte & 127) << shift;
      if (byte < 128) return value;
    }
    ok_ = false;
    return 0;
  }

 private:
  std::span<const uint8_t> rest_;
  bool ok_ = true;
};

// Unused and used squares in turn; only the first run may be empty.
Status read_runs(Reader& in, uint32_t all, std::vector<uint32_t>& mcus) {
  bool used = false;
  for (uint32_t at = 0; at < all; used = !used) {
    const uint32_t run = in.run();
    if (!in.ok() || run > all - at || (run == 0 && at + used > 0))
      return malformed("runs that do not add up");
    for (const uint32_t end = at + run; at < end; ++at)
      if (used) mcus.push_back(at);
  }
  return absl::OkStatus();
}

}  // namespace

Status check_sides(uint32_t width, uint32_t height) {
  if (width > 0 && height > 0 && width % 2 == 0 && height % 2 == 0 && width <= kMaxPictureSide &&
      height <= kMaxPictureSide)
    return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrFormat("atlas of %ux%u: both sides must be even, 2..%u", width, height, kMaxPictureSide));
}

void append_header(const PictureHeader& header, std::vector<uint8_t>& out) {
  append_number(static_cast<uint32_t>(header.codec), 1, out);
  append_number(header.frame, 4, out);
  append_number(header.width, 2, out);
  append_number(header.height, 2, out);
}

std::vector<uint8_t> write_packet(const TiledPicture& picture) {
  std::vector<uint8_t> out;
  append_header(picture.header, out);
  append_runs(picture.mcus, picture.header.mcu_columns() * picture.header.mcu_rows(), out);
  append_number(static_cast<uint32_t>(picture.tables.size()), 2, out);
  out.insert(out.end(), picture.tables.begin(), picture.tables.end());
  for (const auto& tile : picture.tiles) append_number(static_cast<uint32_t>(tile.size()), 4, out);
  for (const auto& tile : picture.tiles) out.insert(out.end(), tile.begin(), tile.end());
  return out;
}

StatusOr<PictureHeader> read_header(std::span<const uint8_t> packet, AtlasCodec expected,
                                    const PictureLimits& limits) {
  Reader in(packet);
  const uint32_t codec = in.number(1);
  PictureHeader header{.codec = expected, .frame = in.number(4)};
  header.width = in.number(2);
  header.height = in.number(2);
  if (!in.ok()) return malformed("shorter than its header");
  if (codec != static_cast<uint32_t>(expected))
    return absl::InvalidArgumentError(absl::StrCat(
        "picture packet: codec ", codec, ", but this session's is ", std::string(name_of(expected))));
  if (header.width == 0 || header.height == 0 || header.width % 2 != 0 || header.height % 2 != 0)
    return malformed("its sides must be even and above 0");
  if (header.width > limits.width || header.height > limits.height)
    return absl::ResourceExhaustedError(
        absl::StrFormat("picture packet: %ux%u is larger than the limit of %ux%u", header.width,
                        header.height, limits.width, limits.height));
  return header;
}

StatusOr<TiledPicture> read_packet(std::span<const uint8_t> packet, const PictureLimits& limits) {
  TiledPicture picture;
  TESSERA_ASSIGN_OR_RETURN(picture.header, read_header(packet, AtlasCodec::jpeg, limits));
  Reader in(packet.subspan(kPictureHeaderBytes));
  TESSERA_RETURN_IF_ERROR(
      read_runs(in, picture.header.mcu_columns() * picture.header.mcu_rows(), picture.mcus));
  picture.tables = in.bytes(in.number(2));
  const size_t tiles = tile_count(picture.mcus.size());
  if (tiles > in.remaining() / 4) return malformed("ends before its tiles' lengths");
  std::vector<uint32_t> lengths(tiles);
  for (uint32_t& length : lengths) length = in.number(4);
  for (size_t i = 0; i < tiles; ++i) {
    picture.tiles.push_back(in.bytes(lengths[i]));
    if (8 * picture.tiles.back().size() < kMinMcuBits * mcus_of_tile(picture.mcus, i).size())
      return malformed("a tile too short for its squares");
  }
  if (!in.ok() || in.remaining() > 0) return malformed("lengths that do not add up");
  return picture;
}

}  // namespace tessera::codec
