#include "codec/raw_codec.h"

#include <gtest/gtest.h>

#include "codec/yuv.h"
#include "pictures.h"

namespace tessera::codec {
namespace {

TEST(RawCodec, EveryByteComesBack) {
  const YuvImage original = noise_picture(34, 18, 1);
  auto encoder = RawEncoder::create(34, 18);
  ASSERT_TRUE(encoder.ok());
  const auto unit = (*encoder)->encode(77, view_of(original), 1, false);
  ASSERT_TRUE(unit.ok());
  EXPECT_TRUE(unit->key_frame);
  RawDecoder decoder(64, 64);
  const auto frame = decoder.decode(unit->bytes);
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_EQ(frame->frame, 77u);
  EXPECT_TRUE(std::equal(original.y.begin(), original.y.end(), frame->picture.y));
  EXPECT_TRUE(std::equal(original.u.begin(), original.u.end(), frame->picture.u));
  EXPECT_TRUE(std::equal(original.v.begin(), original.v.end(), frame->picture.v));
}

TEST(RawCodec, OtherLengthsAndSizesAreRefused) {
  auto encoder = RawEncoder::create(16, 16);
  ASSERT_TRUE(encoder.ok());
  const YuvImage picture = noise_picture(16, 16, 1);
  std::vector<uint8_t> bytes = (*encoder)->encode(0, view_of(picture), 1, false)->bytes;
  EXPECT_EQ(RawDecoder(8, 16).decode(bytes).status().code(), absl::StatusCode::kResourceExhausted);
  bytes.push_back(0);
  EXPECT_EQ(RawDecoder(64, 64).decode(bytes).status().code(), absl::StatusCode::kInvalidArgument);
  bytes.resize(bytes.size() - 2);
  EXPECT_EQ(RawDecoder(64, 64).decode(bytes).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(RawDecoder(64, 64).decode({}).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_FALSE((*encoder)->encode(0, view_of(noise_picture(16, 18, 1)), 1, false).ok());
}

TEST(RawCodec, BothEndsAreMadeByTheCodecsName) {
  for (const auto& [codec, name] : kAtlasCodecs) {
    EXPECT_EQ(atlas_codec_from(name), codec);
    EXPECT_EQ(atlas_codec_from(static_cast<uint8_t>(codec)), codec);
    auto encoder = AtlasEncoder::create(codec, {.width = 64, .height = 32});
    ASSERT_TRUE(encoder.ok()) << encoder.status();
    auto decoder = AtlasDecoder::create(codec);
    ASSERT_TRUE(decoder.ok()) << decoder.status();
    const YuvImage picture = atlas_picture(64, 32, 0, 0);
    const auto unit = (*encoder)->encode(5, view_of(picture), 1e6, true);
    ASSERT_TRUE(unit.ok()) << unit.status();
    const auto frame = (*decoder)->decode(unit->bytes);
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_EQ(frame->frame, 5u) << name;
  }
  EXPECT_EQ(atlas_codec_from(uint8_t{3}), std::nullopt);
  EXPECT_EQ(atlas_codec_from("png"), std::nullopt);
}

}  // namespace
}  // namespace tessera::codec
