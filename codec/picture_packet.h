// The coded picture of JPEG and raw as bytes (docs/protocol.md, "Picture packets"). Safe for untrusted input.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/atlas_codec.h"
#include "base/frame_number.h"
#include "base/status.h"

namespace tessera::codec {

constexpr uint32_t kMcu = 16;  // side of the squares that JPEG codes as a unit with 4:2:0 chroma, in texels
constexpr size_t kTileMcus = 1024;  // in each tile but the last
constexpr uint32_t kMaxPictureSide = 16384;

// What every packet begins with.
struct PictureHeader {
  AtlasCodec codec = AtlasCodec::jpeg;
  FrameNumber frame = 0;
  uint32_t width = 0, height = 0;  // even, 2..kMaxPictureSide

  uint32_t mcu_columns() const { return (width + kMcu - 1) / kMcu; }
  uint32_t mcu_rows() const { return (height + kMcu - 1) / kMcu; }
};

// A picture in JPEG tiles. `mcus`: the squares that hold samples, row by row from the upper left, ascending
// (row * mcu_columns() + column); tile i codes the i-th kTileMcus of them.
struct TiledPicture {
  PictureHeader header;
  std::vector<uint32_t> mcus;
  std::span<const uint8_t> tables;              // that all tiles share
  std::vector<std::span<const uint8_t>> tiles;  // tile_count(mcus.size())
};

constexpr size_t tile_count(size_t mcus) {
  return (mcus + kTileMcus - 1) / kTileMcus;
}
// Of tile `index`.
inline std::span<const uint32_t> mcus_of_tile(std::span<const uint32_t> mcus, size_t index) {
  return mcus.subspan(index * kTileMcus).first(std::min(kTileMcus, mcus.size() - index * kTileMcus));
}

// InvalidArgument: an encoder for pictures of this size cannot be made.
Status check_sides(uint32_t width, uint32_t height);

constexpr size_t kPictureHeaderBytes = 9;
void append_header(const PictureHeader& header, std::vector<uint8_t>& out);
std::vector<uint8_t> write_packet(const TiledPicture& picture);

// The sides that a decoder accepts.
struct PictureLimits {
  uint32_t width = kMaxPictureSide, height = kMaxPictureSide;
};
// InvalidArgument: shorter than a header, another codec, a side that is odd or 0. ResourceExhausted: larger
// than `limits`.
StatusOr<PictureHeader> read_header(std::span<const uint8_t> packet, AtlasCodec expected,
                                    const PictureLimits& limits);
// Spans point into `packet`. InvalidArgument, as above and: counts and lengths that do not add up, tiles that
// are too short for their squares (so that the work is bounded by the bytes).
StatusOr<TiledPicture> read_packet(std::span<const uint8_t> packet, const PictureLimits& limits);

}  // namespace tessera::codec
