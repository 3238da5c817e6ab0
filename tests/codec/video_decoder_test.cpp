#include "codec/video_decoder.h"

#include <gtest/gtest.h>

#include <random>

#include "codec/annex_b.h"
#include "codec/video_encoder.h"
#include "codec/yuv.h"
#include "pictures.h"

namespace tessera::codec {
namespace {

constexpr uint32_t kWidth = 128, kHeight = 96;

// `count` access units from frame `first` on; key frames where `key` says so.
std::vector<AccessUnit> stream(uint32_t count, FrameNumber first, std::vector<uint32_t> keys = {0},
                               uint32_t width = kWidth, uint32_t height = kHeight) {
  auto encoder =
      VideoEncoder::create({.width = width, .height = height, .bitrate_bps = 2e6, .encoder = "x264"});
  EXPECT_TRUE(encoder.ok()) << encoder.status();
  std::vector<AccessUnit> units;
  for (uint32_t i = 0; i < count; ++i) {
    const bool key = std::find(keys.begin(), keys.end(), i) != keys.end();
    auto unit = (*encoder)->encode(first + i, view_of(atlas_picture(width, height, i, 20)),
                                   key ? 200000 : 66000, key);
    EXPECT_TRUE(unit.ok()) << unit.status();
    units.push_back(*std::move(unit));
  }
  return units;
}

std::unique_ptr<VideoDecoder> make_decoder(uint32_t max_width = 8192, uint32_t max_height = 8192) {
  auto decoder = VideoDecoder::create(max_width, max_height);
  EXPECT_TRUE(decoder.ok()) << decoder.status();
  return *std::move(decoder);
}

TEST(VideoDecoder, EveryUnitGivesItsOwnPictureAtOnce) {
  const auto units = stream(20, 100);
  auto decoder = make_decoder();
  for (uint32_t i = 0; i < units.size(); ++i) {
    auto frame = decoder->decode(units[i].bytes);
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_EQ(frame->frame, 100 + i);
    ASSERT_EQ(frame->picture.width, kWidth);
    ASSERT_EQ(frame->picture.height, kHeight);
    const YuvImage original = atlas_picture(kWidth, kHeight, i, 20);
    EXPECT_GT(psnr(view_of(original), frame->picture), 30) << i;
  }
}

TEST(VideoDecoder, FrameNumbersWrap) {
  const auto units = stream(6, UINT32_MAX - 2);
  auto decoder = make_decoder();
  for (uint32_t i = 0; i < units.size(); ++i) {
    auto frame = decoder->decode(units[i].bytes);
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_EQ(frame->frame, static_cast<FrameNumber>(UINT32_MAX - 2 + i));
  }
}

TEST(VideoDecoder, FramesThatWereNeverEncodedLeaveNoGap) {
  auto encoder = VideoEncoder::create({.width = 64, .height = 64, .encoder = "x264"});
  ASSERT_TRUE(encoder.ok()) << encoder.status();
  auto decoder = make_decoder();
  for (FrameNumber number : {3u, 4u, 9u, 70u}) {
    auto unit = (*encoder)->encode(number, view_of(atlas_picture(64, 64, number, 10)), 50000, number == 3);
    ASSERT_TRUE(unit.ok()) << unit.status();
    auto frame = decoder->decode(unit->bytes);
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_EQ(frame->frame, number);
  }
}

TEST(VideoDecoder, AfterALostUnitItWaitsForTheNextKeyFrame) {
  const auto units = stream(12, 0, {0, 8});
  for (uint32_t lost = 1; lost < 7; ++lost) {
    auto decoder = make_decoder();
    for (uint32_t i = 0; i < units.size(); ++i) {
      if (i == lost) continue;
      const auto frame = decoder->decode(units[i].bytes);
      EXPECT_EQ(frame.ok(), i < lost || i >= 8) << "lost " << lost << ", unit " << i;
      if (!frame.ok()) {
        EXPECT_EQ(frame.status().code(), absl::StatusCode::kFailedPrecondition);
      }
    }
  }
}

TEST(VideoDecoder, StartsOnlyAtAKeyFrame) {
  const auto units = stream(5, 0, {0, 3});
  auto decoder = make_decoder();
  for (uint32_t i = 1; i < units.size(); ++i) EXPECT_EQ(decoder->decode(units[i].bytes).ok(), i >= 3) << i;
}

TEST(VideoDecoder, AUnitWithoutAFrameNumberIsRefused) {
  const auto units = stream(1, 0);
  std::vector<uint8_t> without;
  for (Nal nal : split_nals(units[0].bytes)) {
    if (type_of(nal) == NalType::sei) continue;
    without.insert(without.end(), {0, 0, 0, 1});
    without.insert(without.end(), nal.begin(), nal.end());
  }
  auto decoder = make_decoder();
  EXPECT_EQ(decoder->decode(without).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(decoder->decode({}).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_TRUE(decoder->decode(units[0].bytes).ok());
}

TEST(VideoDecoder, PicturesBeyondTheLimitAreRefused) {
  const auto units = stream(1, 0);
  for (const auto& [width, height, fits] :
       {std::tuple{128u, 96u, true}, {126u, 96u, false}, {128u, 94u, false}}) {
    auto decoder = make_decoder(width, height);
    const auto frame = decoder->decode(units[0].bytes);
    EXPECT_EQ(frame.ok(), fits) << frame.status();
    if (!fits) {
      EXPECT_EQ(frame.status().code(), absl::StatusCode::kResourceExhausted);
    }
  }
}

TEST(VideoDecoder, TheSizeMayChangeAtAKeyFrame) {
  auto decoder = make_decoder();
  for (uint32_t side : {64u, 256u, 32u}) {
    const auto units = stream(2, 5, {0}, side, side);
    for (const AccessUnit& unit : units) {
      auto frame = decoder->decode(unit.bytes);
      ASSERT_TRUE(frame.ok()) << frame.status();
      EXPECT_EQ(frame->picture.width, side);
    }
  }
}

TEST(VideoDecoder, TruncatedUnitsAreErrorsAndTheNextKeyFrameHeals) {
  const auto units = stream(3, 0, {0, 2});
  auto decoder = make_decoder();
  for (int target : {0, 1}) {
    const std::vector<uint8_t>& whole = units[target].bytes;
    for (size_t size = 0; size < whole.size(); size += std::max<size_t>(1, whole.size() / 60)) {
      if (target == 1) {
        ASSERT_TRUE(decoder->decode(units[0].bytes).ok());
      }
      // On the heap at the exact size, for the address sanitizer.
      const std::vector<uint8_t> part(whole.begin(), whole.begin() + static_cast<ptrdiff_t>(size));
      EXPECT_FALSE(decoder->decode(part).ok()) << size << " of " << whole.size();
      EXPECT_FALSE(decoder->decode(units[1].bytes).ok());
      const auto healed = decoder->decode(units[2].bytes);
      ASSERT_TRUE(healed.ok()) << healed.status();
      EXPECT_GT(psnr(view_of(atlas_picture(kWidth, kHeight, 2, 20)), healed->picture), 30);
    }
  }
}

TEST(VideoDecoder, FlippedBitsAndNoiseNeverCrash) {
  const auto units = stream(4, 0, {0, 3});
  auto decoder = make_decoder(512, 512);
  std::mt19937 random(3);
  int errors = 0;
  for (int round = 0; round < 400; ++round) {
    for (uint32_t i = 0; i < 3; ++i) {
      std::vector<uint8_t> bytes = units[i].bytes;
      for (uint32_t flips = random() % 4; flips > 0; --flips)
        bytes[random() % bytes.size()] ^= static_cast<uint8_t>(1u << random() % 8);
      errors += !decoder->decode(bytes).ok();
    }
    std::vector<uint8_t> noise = units[0].bytes;
    for (size_t i = noise.size() / 4; i < noise.size(); ++i) noise[i] = static_cast<uint8_t>(random());
    errors += !decoder->decode(noise).ok();
  }
  EXPECT_GT(errors, 100);
  auto healed = decoder->decode(units[3].bytes);
  ASSERT_TRUE(healed.ok()) << healed.status();
  EXPECT_GT(psnr(view_of(atlas_picture(kWidth, kHeight, 3, 20)), healed->picture), 30);
}

}  // namespace
}  // namespace tessera::codec
