// The JPEG encoder and decoder together.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>

#include "codec/jpeg_decoder.h"
#include "codec/jpeg_encoder.h"
#include "codec/jpeg_tile.h"
#include "codec/mcu_tiles.h"
#include "codec/picture_packet.h"
#include "codec/yuv.h"
#include "pictures.h"

namespace tessera::codec {
namespace {

using Bytes = std::vector<uint8_t>;
constexpr double kPlenty = 1e9;

Bytes encode(const AtlasPicture& picture, double budget_bits = kPlenty, FrameNumber frame = 1) {
  auto encoder = JpegEncoder::create(picture.yuv.width, picture.yuv.height);
  EXPECT_TRUE(encoder.ok()) << encoder.status();
  auto unit = (*encoder)->encode(frame, picture, budget_bits, false);
  EXPECT_TRUE(unit.ok()) << unit.status();
  EXPECT_TRUE(unit->key_frame);
  return unit->bytes;
}

Status decode_status(std::span<const uint8_t> bytes) {
  return JpegDecoder(8192, 8192).decode(bytes).status();
}

// Mean square error of luma, over the used texels.
double error_where_used(const YuvView& a, const YuvView& b, const Occupancy& used) {
  double sum = 0;
  for (uint32_t y = 0; y < a.height; ++y)
    for (uint32_t x = 0; x < a.width; ++x) {
      if (!used.uses(x, y)) continue;
      const double d = double{0} + a.y[size_t{y} * a.y_stride + x] - b.y[size_t{y} * b.y_stride + x];
      sum += d * d;
    }
  return sum / static_cast<double>(used.texels());
}

// Of every 32x32 texels the triangle below the diagonal, so that many blocks are partly used.
Occupancy triangles(uint32_t width, uint32_t height) {
  Occupancy used(width, height);
  for (uint32_t y = 0; y < height; y += 2)
    for (uint32_t x = 0; x < width; x += 32) used.add_rectangle(x, y, y % 32 + 2, 2);
  return used;
}

// `picture` where it is used, `filling` elsewhere.
YuvImage with_filling(const YuvImage& picture, const Occupancy& used, const YuvImage& filling) {
  YuvImage out = picture;
  for (uint32_t y = 0; y < picture.height; ++y)
    for (uint32_t x = 0; x < picture.width; ++x) {
      if (used.uses(x, y)) continue;
      const size_t luma = size_t{y} * picture.width + x, chroma = size_t{y / 2} * (picture.width / 2) + x / 2;
      out.y[luma] = filling.y[luma];
      out.u[chroma] = filling.u[chroma];
      out.v[chroma] = filling.v[chroma];
    }
  return out;
}

YuvImage grey(uint32_t width, uint32_t height, uint8_t luma) {
  YuvImage image;
  resize(width, height, image);
  std::ranges::fill(image.y, luma);
  std::ranges::fill(image.u, 128);
  std::ranges::fill(image.v, 128);
  return image;
}

TEST(JpegCodec, PicturesOfAnySizeComeBack) {
  // One square and less, several tiles (1024 squares each), sides that are not multiples of 16.
  for (const auto& [width, height] :
       {std::pair(2u, 2u), {16u, 16u}, {18u, 34u}, {254u, 30u}, {1030u, 610u}}) {
    const YuvImage original = atlas_picture(width, height, 0, 0);
    JpegDecoder decoder(8192, 8192);
    const auto frame = decoder.decode(encode(view_of(original), kPlenty, 0xfedcba98));
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_EQ(frame->frame, 0xfedcba98);
    ASSERT_EQ(frame->picture.width, width);
    ASSERT_EQ(frame->picture.height, height);
    EXPECT_GT(psnr(view_of(original), frame->picture), 40) << width << "x" << height;
    const YuvView& p = frame->picture;
    const YuvView u_as_luma{width / 2, height / 2, p.u, p.u, p.v, p.uv_stride, p.uv_stride};
    const YuvView expected_u{width / 2, height / 2, original.u.data(), nullptr,
                             nullptr,   width / 2,  width / 2};
    EXPECT_GT(psnr(expected_u, u_as_luma), 40) << width << "x" << height;
  }
}

TEST(JpegCodec, FramesStandByThemselves) {
  auto encoder = JpegEncoder::create(128, 64);
  ASSERT_TRUE(encoder.ok());
  std::vector<AccessUnit> units;
  for (FrameNumber n = 0; n < 4; ++n)
    units.push_back(*(*encoder)->encode(n, view_of(atlas_picture(128, 64, n, 50)), kPlenty, false));
  JpegDecoder decoder(8192, 8192);
  for (const FrameNumber n : {3u, 0u, 2u}) {
    const auto frame = decoder.decode(units[n].bytes);
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_EQ(frame->frame, n);
    EXPECT_GT(psnr(view_of(atlas_picture(128, 64, n, 50)), frame->picture), 40);
  }
}

TEST(JpegCodec, BudgetsAreKept) {
  constexpr uint32_t kWidth = 1024, kHeight = 512;
  auto encoder = JpegEncoder::create(kWidth, kHeight);
  ASSERT_TRUE(encoder.ok());
  FrameNumber n = 0;
  // Suddenly more, suddenly less; the picture changes, too.
  for (const double bits_per_texel : {1.0, 1.0, 0.5, 2.0, 0.3, 0.3, 1.5}) {
    const double budget = bits_per_texel * kWidth * kHeight;
    const auto unit = (*encoder)->encode(n, view_of(atlas_picture(kWidth, kHeight, n, 30)), budget, false);
    ASSERT_TRUE(unit.ok()) << unit.status();
    EXPECT_LE(8.0 * static_cast<double>(unit->bytes.size()), budget) << "frame " << n;
    EXPECT_GE(8.0 * static_cast<double>(unit->bytes.size()), 0.9 * budget) << "frame " << n;
    ++n;
  }
}

// What the encoder plans by is a sample; its places must not be those of a few columns.
TEST(JpegCodec, BudgetsAreKeptWhereTheAtlasIsFlatInPart) {
  for (const uint32_t side : {512u, 1024u}) {
    YuvImage picture = atlas_picture(side, side, 0, 30);
    for (uint32_t y = 0; y < side; ++y)
      for (const uint32_t x : {0u, side / 2}) std::fill_n(&picture.y[size_t{y} * side + x], 64, uint8_t{128});
    const double budget = 0.6 * side * side;
    const double bits = 8.0 * static_cast<double>(encode(view_of(picture), budget).size());
    EXPECT_LE(bits, budget) << side;
    EXPECT_GE(bits, 0.85 * budget) << side;
  }
}

// The longest codes for the most coefficients: no picture is too large for the compressor.
TEST(JpegCodec, CodesForAFlatPictureCodeNoise) {
  JpegCompressor compressor;
  const auto fitted = compressor.codes_for(grey(256, 256, 128), kFinestScale);
  ASSERT_TRUE(fitted.ok()) << fitted.status();
  const YuvImage noise = noise_picture(256, 256, 1);
  const auto tables = compressor.tables(kFinestScale, fitted->codes);
  const auto tile = compressor.compress(noise, kFinestScale, fitted->codes);
  ASSERT_TRUE(tables.ok() && tile.ok()) << tile.status();
  EXPECT_GT(tile->size(), 3 * noise.y.size()) << "else this tests nothing";
  YuvImage decoded;
  resize(256, 256, decoded);
  ASSERT_TRUE(JpegDecompressor().decompress(*tables, *tile, decoded).ok());
  EXPECT_GT(psnr(view_of(noise), view_of(decoded)), 40);
}

TEST(JpegCodec, APictureBringsItsOwnTables) {
  const Bytes whole = encode(view_of(atlas_picture(64, 64, 0, 0)));
  auto picture = read_packet(whole, {});
  ASSERT_TRUE(picture.ok()) << picture.status();
  const Bytes none = {0xff, 0xd8, 0xff, 0xd9};
  picture->tables = none;
  JpegDecoder decoder(8192, 8192);
  ASSERT_TRUE(decoder.decode(whole).ok());
  EXPECT_EQ(decoder.decode(write_packet(*picture)).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_TRUE(decoder.decode(whole).ok());
}

TEST(JpegCodec, BudgetsOutOfReachGiveTheCoarsestOrTheFinestPicture) {
  const YuvImage noise = noise_picture(256, 256, 1);
  const Bytes coarse = encode(view_of(noise), 1000), fine = encode(view_of(noise), kPlenty);
  EXPECT_LT(coarse.size(), fine.size() / 5);
  EXPECT_TRUE(decode_status(coarse).ok());
  EXPECT_TRUE(decode_status(fine).ok());
  const Bytes flat = encode(view_of(grey(256, 256, 100)), kPlenty);
  EXPECT_LT(flat.size(), 2000) << "a budget is no reason to waste bits";
}

TEST(JpegCodec, TexelsWithoutSamplesCostNextToNothing) {
  constexpr uint32_t kWidth = 1024, kHeight = 1024;
  const YuvImage picture = atlas_picture(kWidth, kHeight, 0, 0);
  Occupancy half(kWidth, kHeight), scattered(kWidth, kHeight), one(kWidth, kHeight), none(kWidth, kHeight);
  half.add_rectangle(0, 0, kWidth, kHeight / 2);
  for (uint32_t y = 0; y < kHeight; y += 16)
    for (uint32_t x = y % 32; x < kWidth; x += 32) scattered.add_rectangle(x, y, 16, 16);
  one.add_rectangle(500, 500, 2, 2);
  ASSERT_EQ(half.texels(), scattered.texels());

  // Plenty of bits: all have the same, finest quantisers.
  const auto size = [&](const Occupancy& used) {
    return static_cast<double>(encode({view_of(picture), &used}).size());
  };
  const auto whole = static_cast<double>(encode(view_of(picture)).size());
  EXPECT_LT(size(half), 0.52 * whole);
  EXPECT_LT(size(scattered), 0.55 * whole);
  EXPECT_LT(size(one), 1100) << "of which the tables are most";
  EXPECT_LT(size(none), 20);
  EXPECT_TRUE(decode_status(encode({view_of(picture), &none})).ok());
}

TEST(JpegCodec, WhatLiesInUnusedTexelsDoesNotMatter) {
  const YuvImage picture = atlas_picture(256, 128, 0, 0);
  const Occupancy used = triangles(256, 128);
  const YuvImage noisy = with_filling(picture, used, noise_picture(256, 128, 5));
  EXPECT_EQ(encode({view_of(picture), &used}, 30000), encode({view_of(noisy), &used}, 30000));
}

// TSS: no triangle boundary may ring into its samples.
TEST(JpegCodec, PaddingSparesBitsAndDoesNotRing) {
  constexpr uint32_t kWidth = 512, kHeight = 256;
  constexpr double kBudget = 0.6 * kWidth * kHeight;
  const YuvImage picture = atlas_picture(kWidth, kHeight, 0, 0);
  const Occupancy used = triangles(kWidth, kHeight);
  const auto error = [&](const YuvImage& coded, const Occupancy* told) {
    JpegDecoder decoder(8192, 8192);
    const auto frame = decoder.decode(encode({view_of(coded), told}, kBudget));
    EXPECT_TRUE(frame.ok()) << frame.status();
    return error_where_used(view_of(picture), frame->picture, used);
  };
  const double padded = error(picture, &used);
  const double black = error(with_filling(picture, used, grey(kWidth, kHeight, 16)), nullptr);
  const double stale = error(with_filling(picture, used, atlas_picture(kWidth, kHeight, 1, 100)), nullptr);
  EXPECT_LT(padded, 0.5 * black);
  EXPECT_LT(padded, 0.5 * stale);
}

// With quantisers of its own for each, the budget is out of the way: a sample beside an edge must not come
// back worse than it does in a block that is used throughout.
TEST(JpegCodec, PartlyUsedBlocksAreAsGoodAsWholeOnes) {
  constexpr uint32_t kSide = 256;
  YuvImage picture = grey(kSide, kSide, 0);
  for (uint32_t y = 0; y < kSide; ++y)
    for (uint32_t x = 0; x < kSide; ++x)
      picture.y[size_t{y} * kSide + x] = static_cast<uint8_t>(126 + 60 * std::sin(0.1 * x + 0.15 * y));
  const Occupancy used = triangles(kSide, kSide);
  // The same quantisers for both: a tile's, without an encoder's search.
  const auto error = [&](const Occupancy& told) {
    const std::vector<uint32_t> mcus = used_mcus(told);
    YuvImage tile, back = grey(kSide, kSide, 0);
    gather({view_of(picture), &told}, mcus, tile);
    JpegCompressor compressor;
    const auto fitted = compressor.codes_for(tile, 1);
    EXPECT_TRUE(fitted.ok());
    const auto tables = compressor.tables(1, fitted->codes),
               bytes = compressor.compress(tile, 1, fitted->codes);
    EXPECT_TRUE(tables.ok() && bytes.ok());
    EXPECT_TRUE(JpegDecompressor().decompress(*tables, *bytes, tile).ok());
    scatter(tile, mcus, back);
    return error_where_used(view_of(picture), view_of(back), used);
  };
  Occupancy all(kSide, kSide);
  all.add_rectangle(0, 0, kSide, kSide);
  EXPECT_LT(error(used), 1.5 * error(all));
}

TEST(JpegCodec, GatheredSquaresGoBackToTheirPlaces) {
  const YuvImage picture = noise_picture(90, 70, 3);
  Occupancy used(90, 70);
  used.add_rectangle(20, 4, 40, 30);
  used.add_rectangle(70, 50, 20, 20);
  const std::vector<uint32_t> mcus = used_mcus(used);
  YuvImage tile, back = grey(90, 70, 0);
  gather({view_of(picture), &used}, mcus, tile);
  scatter(tile, mcus, back);
  EXPECT_EQ(error_where_used(view_of(picture), view_of(back), used), 0);
  EXPECT_EQ(back.y[0], 0) << "a square without samples stays";
  EXPECT_EQ(back.u[2 * 45 + 11], picture.u[2 * 45 + 11]);
  EXPECT_EQ(back.v[30 * 45 + 40], picture.v[30 * 45 + 40]);
}

TEST(JpegCodec, RefusesPicturesAndBudgetsThatMakeNoSense) {
  for (const auto& [width, height] : {std::pair(0u, 16u), {15u, 16u}, {16u, 16386u}})
    EXPECT_EQ(JpegEncoder::create(width, height).status().code(), absl::StatusCode::kInvalidArgument);
  auto encoder = JpegEncoder::create(64, 64);
  ASSERT_TRUE(encoder.ok());
  const YuvImage good = noise_picture(64, 64, 1), other = noise_picture(64, 32, 1);
  const Occupancy wrong(32, 32);
  for (const double budget : {0.0, -1.0, std::nan("")})
    EXPECT_EQ((*encoder)->encode(0, view_of(good), budget, false).status().code(),
              absl::StatusCode::kInvalidArgument);
  EXPECT_FALSE((*encoder)->encode(0, view_of(other), 1e5, false).ok());
  EXPECT_FALSE((*encoder)->encode(0, {view_of(good), &wrong}, 1e5, false).ok());
  EXPECT_TRUE((*encoder)->encode(0, view_of(good), 1e5, false).ok()) << "and goes on";
}

TEST(JpegCodec, PicturesBeyondTheLimitAreRefused) {
  const Bytes packet = encode(view_of(noise_picture(64, 32, 1)));
  EXPECT_TRUE(JpegDecoder(64, 32).decode(packet).ok());
  EXPECT_EQ(JpegDecoder(62, 32).decode(packet).status().code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(JpegDecoder(64, 30).decode(packet).status().code(), absl::StatusCode::kResourceExhausted);
}

TEST(JpegCodec, DamageIsAnErrorAndTheNextPictureIsWhole) {
  const YuvImage original = atlas_picture(320, 96, 0, 0);
  const Bytes packet = encode(view_of(original), 60000);
  const TiledPicture parts = *read_packet(packet, {});
  const auto with_tile = [&](std::span<const uint8_t> tile) {
    TiledPicture changed = parts;
    changed.tiles[0] = tile;
    return write_packet(changed);
  };
  JpegDecoder decoder(8192, 8192);
  std::mt19937 random(1);
  for (int round = 0; round < 300; ++round) {
    const auto cut = parts.tiles[0].first(random() % parts.tiles[0].size());
    EXPECT_EQ(decoder.decode(with_tile(cut)).status().code(), absl::StatusCode::kInvalidArgument);
    Bytes damaged(packet);
    for (int flips = 1 + round % 4; flips > 0; --flips)
      damaged[random() % damaged.size()] ^= static_cast<uint8_t>(1u << random() % 8);
    (void)decoder.decode(damaged);  // any picture or an error, but nothing worse
    const auto whole = decoder.decode(packet);
    ASSERT_TRUE(whole.ok()) << whole.status();
    ASSERT_GT(psnr(view_of(original), whole->picture), 30);
  }
}

TEST(JpegCodec, TilesOfAnotherKindAreRefused) {
  const Bytes packet = encode(view_of(atlas_picture(64, 64, 0, 0)));
  const TiledPicture parts = *read_packet(packet, {});
  const auto code_of = [](const TiledPicture& picture) {
    return decode_status(write_packet(picture)).code();
  };
  const Bytes good(parts.tiles[0].begin(), parts.tiles[0].end());
  // SOI, then SOF0: marker, length, precision, height, width, components of three bytes each.
  ASSERT_EQ(good[3], 0xc0);
  for (const auto& [at, value] : {std::pair<size_t, uint8_t>(3, 0xc2),
                                  {3, 0xc9},
                                  {6, 12},
                                  {8, 48},
                                  {10, 48},
                                  {11, 1},
                                  {13, 0x11},
                                  {16, 0x22}}) {
    Bytes tile = good;
    tile[at] = value;
    TiledPicture picture = parts;
    picture.tiles[0] = tile;
    EXPECT_EQ(code_of(picture), absl::StatusCode::kInvalidArgument) << "byte " << at;
  }
  TiledPicture without_tables = parts, swapped = parts, longer = parts;
  without_tables.tables = {};
  swapped.tables = parts.tiles[0];
  Bytes tail = good;
  tail.push_back(0);
  longer.tiles[0] = tail;
  for (const TiledPicture& picture : {without_tables, swapped, longer})
    EXPECT_EQ(code_of(picture), absl::StatusCode::kInvalidArgument);
}

// Tables and tile put together are a JPEG file like any other.
TEST(JpegCodec, FfmpegDecodesATileToTheSamePicture) {
  constexpr uint32_t kWidth = 256, kHeight = 64;
  const YuvImage original = atlas_picture(kWidth, kHeight, 0, 0);
  const Bytes packet = encode(view_of(original), 0.8 * kWidth * kHeight);
  const TiledPicture parts = *read_packet(packet, {});
  const auto stem =
      std::filesystem::path(testing::TempDir()) / ("tessera_jpeg_" + std::to_string(std::random_device{}()));
  const std::string jpeg = stem.string() + ".jpg", planes = stem.string() + ".yuv";
  {
    std::ofstream out(jpeg, std::ios::binary);
    const auto write = [&](std::span<const uint8_t> bytes) {
      out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    };
    write(parts.tables.first(parts.tables.size() - 2));  // without EOI
    write(parts.tiles[0].subspan(2));                    // without SOI
  }
  const std::string command =
      "ffmpeg -v error -y -i " + jpeg + " -pix_fmt yuvj420p -f rawvideo " + planes + " 2>&1";
  const int code = std::system(command.c_str());
  std::ifstream in(planes, std::ios::binary);
  const Bytes theirs{std::istreambuf_iterator<char>(in), {}};
  std::filesystem::remove(jpeg);
  std::filesystem::remove(planes);
  if (WEXITSTATUS(code) == 127) GTEST_SKIP() << "ffmpeg is not installed";
  ASSERT_EQ(theirs.size(), kWidth * kHeight * 3 / 2);

  JpegDecoder decoder(8192, 8192);
  const auto ours = decoder.decode(packet);
  ASSERT_TRUE(ours.ok()) << ours.status();
  const YuvView& p = ours->picture;
  Bytes planes_of_ours(p.y, p.y + kWidth * kHeight);
  planes_of_ours.insert(planes_of_ours.end(), p.u, p.u + kWidth * kHeight / 4);
  planes_of_ours.insert(planes_of_ours.end(), p.v, p.v + kWidth * kHeight / 4);
  int largest = 0;  // the standard leaves the inverse transform's rounding open
  for (size_t i = 0; i < theirs.size(); ++i)
    largest = std::max(largest, std::abs(theirs[i] - planes_of_ours[i]));
  EXPECT_LE(largest, 2);
}

}  // namespace
}  // namespace tessera::codec
