#include "codec/mcu_tiles.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "codec/padding.h"
#include "codec/picture_packet.h"
#include "codec/yuv.h"

namespace tessera::codec {
namespace {

constexpr uint32_t kBlock = Occupancy::kBlock;
constexpr size_t kTileColumns = 16;  // a nearly square tile, and few squares to fill up its last row

struct Plane {
  uint8_t* data;
  size_t stride;
};
struct ConstPlane {
  const uint8_t* data;
  size_t stride, width, height;
};

// A square of `side` values, clipped at the source's borders: the rest is unused, and padded.
void copy_square(const ConstPlane& from, size_t x, size_t y, const Plane& to, size_t side) {
  const size_t columns = std::min(side, from.width - x), rows = std::min(side, from.height - y);
  for (size_t row = 0; row < rows; ++row)
    std::memcpy(to.data + row * to.stride, from.data + (y + row) * from.stride + x, columns);
}

// The chroma samples that a block's used texels touch: the upper left quarter of the bits.
uint64_t chroma_quarter(uint64_t used) {
  uint64_t quarter = 0;
  for (uint32_t y = 0; y < kBlock / 2; ++y)
    for (uint32_t x = 0; x < kBlock / 2; ++x)
      if (used >> (2 * kBlock * y + 2 * x) & 0x303) quarter |= uint64_t{1} << (kBlock * y + x);
  return quarter;
}

struct McuBlocks {
  std::array<uint64_t, 4> luma;  // row by row, as JPEG codes them
  uint64_t chroma;
};

McuBlocks blocks_of(const Occupancy& used, uint32_t column, uint32_t row) {
  McuBlocks blocks{};
  for (uint32_t i = 0; i < 4; ++i) blocks.luma[i] = used.block(2 * column + i % 2, 2 * row + i / 2);
  const bool full = std::ranges::all_of(blocks.luma, [](uint64_t b) { return b == Occupancy::kFull; });
  if (full) {
    blocks.chroma = Occupancy::kFull;
    return blocks;
  }
  for (uint32_t i = 0; i < 4; ++i)
    blocks.chroma |= chroma_quarter(blocks.luma[i]) << (kBlock / 2 * (i % 2) + kBlock * kBlock / 2 * (i / 2));
  return blocks;
}

// JPEG codes each component's blocks by their means' difference to the block before; this is that one.
struct BlockBefore {
  const uint8_t* block = nullptr;
  size_t stride = 0;

  void fill_up(const Plane& next) const {
    fill_block(next.data, next.stride, block ? block_mean(block, stride) : 128);
  }
};

void pad(const Plane& block, uint64_t used, BlockBefore& before) {
  if (used == 0) {
    before.fill_up(block);
  } else if (used != Occupancy::kFull) {
    pad_block(block.data, block.stride, used);
  }
  before = {block.data, block.stride};
}

// The tile's planes at its `index`-th square.
std::array<Plane, 3> at_square(YuvImage& tile, size_t index) {
  const size_t columns = tile.width / kMcu, x = index % columns, y = index / columns;
  const size_t luma = (y * tile.width + x) * kMcu, chroma = (y * (tile.width / 2) + x) * (kMcu / 2);
  return {{{tile.y.data() + luma, tile.width},
           {tile.u.data() + chroma, tile.width / 2},
           {tile.v.data() + chroma, tile.width / 2}}};
}

Plane luma_block(const Plane& square, size_t i) {
  return {square.data + (i / 2 * square.stride + i % 2) * kBlock, square.stride};
}

}  // namespace

std::vector<uint32_t> used_mcus(const Occupancy& used) {
  const PictureHeader size{.width = used.width(), .height = used.height()};
  std::vector<uint32_t> mcus;
  for (uint32_t row = 0; row < size.mcu_rows(); ++row)
    for (uint32_t column = 0; column < size.mcu_columns(); ++column)
      if (used.block(2 * column, 2 * row) | used.block(2 * column + 1, 2 * row) |
          used.block(2 * column, 2 * row + 1) | used.block(2 * column + 1, 2 * row + 1))
        mcus.push_back(row * size.mcu_columns() + column);
  return mcus;
}

void resize_tile(size_t mcus, YuvImage& tile) {
  const size_t columns = std::min(mcus, kTileColumns), rows = (mcus + kTileColumns - 1) / kTileColumns;
  resize(static_cast<uint32_t>(columns * kMcu), static_cast<uint32_t>(rows * kMcu), tile);
}

void gather(const AtlasPicture& picture, std::span<const uint32_t> mcus, YuvImage& tile) {
  const YuvView& yuv = picture.yuv;
  const uint32_t columns = PictureHeader{.width = yuv.width}.mcu_columns();
  const std::array<ConstPlane, 3> from = {{{yuv.y, yuv.y_stride, yuv.width, yuv.height},
                                           {yuv.u, yuv.uv_stride, yuv.width / 2, yuv.height / 2},
                                           {yuv.v, yuv.uv_stride, yuv.width / 2, yuv.height / 2}}};
  resize_tile(mcus.size(), tile);
  std::array<BlockBefore, 3> before;
  for (size_t i = 0; i < tile.y.size() / (kMcu * kMcu); ++i) {
    const std::array<Plane, 3> to = at_square(tile, i);
    McuBlocks used{};
    if (i < mcus.size()) {
      const uint32_t x = mcus[i] % columns, y = mcus[i] / columns;
      used = blocks_of(*picture.used, x, y);
      for (size_t p = 0; p < 3; ++p) {
        const uint32_t side = p == 0 ? kMcu : kMcu / 2;
        copy_square(from[p], size_t{x} * side, size_t{y} * side, to[p], side);
      }
    }
    for (size_t b = 0; b < 4; ++b) pad(luma_block(to[0], b), used.luma[b], before[0]);
    for (size_t p = 1; p < 3; ++p) pad(to[p], used.chroma, before[p]);
  }
}

void scatter(const YuvImage& tile, std::span<const uint32_t> mcus, YuvImage& picture) {
  const uint32_t columns = PictureHeader{.width = picture.width}.mcu_columns();
  const size_t tile_columns = tile.width / kMcu;
  const std::array<ConstPlane, 3> from = {{{tile.y.data(), tile.width, tile.width, tile.height},
                                           {tile.u.data(), tile.width / 2, tile.width / 2, tile.height / 2},
                                           {tile.v.data(), tile.width / 2, tile.width / 2, tile.height / 2}}};
  const std::array<uint8_t*, 3> to = {picture.y.data(), picture.u.data(), picture.v.data()};
  for (size_t i = 0; i < mcus.size(); ++i)
    for (size_t p = 0; p < 3; ++p) {
      const size_t shift = p == 0 ? 0 : 1, side = kMcu >> shift;
      const size_t width = picture.width >> shift, height = picture.height >> shift;
      const size_t x = mcus[i] % columns * side, y = mcus[i] / columns * side;
      const ConstPlane square{from[p].data + (i / tile_columns * from[p].stride + i % tile_columns) * side,
                              from[p].stride, width - x, height - y};
      copy_square(square, 0, 0, {to[p] + y * width + x, width}, side);
    }
}

}  // namespace tessera::codec
