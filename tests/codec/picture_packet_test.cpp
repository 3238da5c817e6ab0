#include "codec/picture_packet.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>
#include <random>

namespace tessera::codec {
namespace {

using Bytes = std::vector<uint8_t>;
constexpr PictureLimits kLimits{8192, 8192};

absl::StatusCode read_code(const Bytes& bytes) {
  return read_packet(bytes, kLimits).status().code();
}

// 64x48 texels: 4 x 3 squares, of which 1, 2 and 11 are used.
TiledPicture small_picture(const Bytes& tables, const Bytes& tile) {
  return {{AtlasCodec::jpeg, 0x01020304, 64, 48}, {1, 2, 11}, tables, {tile}};
}

// The vector of docs/protocol.md.
TEST(PicturePacket, HasItsDocumentedBytes) {
  const Bytes tables{0xaa, 0xbb}, tile{1, 2, 3, 4, 5};
  EXPECT_THAT(write_packet(small_picture(tables, tile)), testing::ElementsAre(1, 1, 2, 3, 4, 0, 64, 0, 48,  //
                                                                              1, 2, 8, 1,        // runs
                                                                              0, 2, 0xaa, 0xbb,  //
                                                                              0, 0, 0, 5, 1, 2, 3, 4, 5));
}

TEST(PicturePacket, ReadsWhatItWrites) {
  std::mt19937 random(1);
  for (int round = 0; round < 50; ++round) {
    TiledPicture picture;
    const auto below = [&](uint32_t end) { return static_cast<uint32_t>(random() % end); };
    picture.header = {AtlasCodec::jpeg, below(UINT32_MAX), 2 + 2 * below(600), 2 + 2 * below(600)};
    const uint32_t all = picture.header.mcu_columns() * picture.header.mcu_rows(), density = below(5);
    for (uint32_t i = 0; i < all; ++i)
      if (random() % 4 < density) picture.mcus.push_back(i);
    const Bytes tables(random() % 100, 7);
    picture.tables = tables;
    std::vector<Bytes> tiles(tile_count(picture.mcus.size()));
    for (Bytes& tile : tiles) tile.resize(1536 + random() % 100, static_cast<uint8_t>(random()));
    picture.tiles.assign(tiles.begin(), tiles.end());

    const Bytes packet = write_packet(picture);
    const StatusOr<TiledPicture> read = read_packet(packet, kLimits);
    ASSERT_TRUE(read.ok()) << read.status();
    EXPECT_EQ(read->header.frame, picture.header.frame);
    EXPECT_EQ(read->header.width, picture.header.width);
    EXPECT_EQ(read->header.height, picture.header.height);
    EXPECT_EQ(read->mcus, picture.mcus);
    EXPECT_TRUE(std::ranges::equal(read->tables, tables));
    ASSERT_EQ(read->tiles.size(), tiles.size());
    for (size_t i = 0; i < tiles.size(); ++i) EXPECT_TRUE(std::ranges::equal(read->tiles[i], tiles[i]));
  }
}

TEST(PicturePacket, EveryCutIsAnError) {
  const Bytes tables{0xaa, 0xbb}, tile{1, 2, 3, 4, 5};
  const Bytes packet = write_packet(small_picture(tables, tile));
  ASSERT_EQ(read_code(packet), absl::StatusCode::kOk);
  for (size_t size = 0; size < packet.size(); ++size)
    EXPECT_EQ(read_code(Bytes(packet.begin(), packet.begin() + static_cast<ptrdiff_t>(size))),
              absl::StatusCode::kInvalidArgument)
        << size;
  Bytes longer = packet;
  longer.push_back(0);
  EXPECT_EQ(read_code(longer), absl::StatusCode::kInvalidArgument);
}

TEST(PicturePacket, LiesAreErrors) {
  const Bytes tables{0xaa, 0xbb}, tile{1, 2, 3, 4, 5};
  const auto code_with = [&](size_t at, uint8_t value) {
    Bytes packet = write_packet(small_picture(tables, tile));
    packet[at] = value;
    return read_code(packet);
  };
  using enum absl::StatusCode;
  EXPECT_EQ(code_with(0, 2), kInvalidArgument) << "another codec";
  EXPECT_EQ(code_with(6, 63), kInvalidArgument) << "an odd side";
  EXPECT_EQ(code_with(6, 0), kInvalidArgument) << "no side";
  EXPECT_EQ(code_with(5, 0x20), kResourceExhausted) << "8256 wide";
  EXPECT_EQ(code_with(10, 0), kInvalidArgument) << "an empty run";
  EXPECT_EQ(code_with(12, 2), kInvalidArgument) << "a run beyond the picture";
  EXPECT_EQ(code_with(11, 0xff), kInvalidArgument) << "a run's bytes that go on";
  EXPECT_EQ(code_with(14, 3), kInvalidArgument) << "longer tables";
  EXPECT_EQ(code_with(17, 0xff), kInvalidArgument) << "a tile of 4 GB";
  EXPECT_EQ(code_with(20, 4), kInvalidArgument) << "a byte left over";
  // Three squares take 36 bits at least.
  EXPECT_EQ(read_code(write_packet(small_picture(tables, Bytes{1, 2, 3, 4}))), kInvalidArgument);
}

// All the squares of the largest picture, in a few bytes: the work is bounded by the bytes that came.
TEST(PicturePacket, SmallPacketsCannotOrderLargeWork) {
  TiledPicture picture;
  picture.header = {AtlasCodec::jpeg, 0, 8192, 8192};
  picture.mcus.resize(512 * 512);
  std::iota(picture.mcus.begin(), picture.mcus.end(), 0u);
  const Bytes tile(64);
  picture.tiles.assign(tile_count(picture.mcus.size()), tile);
  EXPECT_EQ(read_code(write_packet(picture)), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace tessera::codec
