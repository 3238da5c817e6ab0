// Coders are not thread-safe, but independent: each thread may have its own.
#include <gtest/gtest.h>

#include <string>
#include <thread>
#include <vector>

#include "codec/jpeg_decoder.h"
#include "codec/jpeg_encoder.h"
#include "codec/video_decoder.h"
#include "codec/video_encoder.h"
#include "codec/yuv.h"
#include "pictures.h"

namespace tessera::codec {
namespace {

constexpr uint32_t kSide = 64;

struct Outcome {
  uint32_t decoded = 0;
  Status after_noise;
};

// A stream of its own through a coder and a decoder of its own, then noise.
Outcome run_stream(uint32_t first, uint32_t count) {
  Outcome outcome;
  auto encoder =
      VideoEncoder::create({.width = kSide, .height = kSide, .encoder = "x264", .preset = "ultrafast"});
  auto decoder = VideoDecoder::create();
  if (!encoder.ok() || !decoder.ok()) return outcome;
  for (uint32_t i = 0; i <= count; ++i) {
    const YuvImage original = atlas_picture(kSide, kSide, first + i, 20);
    auto unit = (*encoder)->encode(first + i, view_of(original), 100000, i == 0);
    if (!unit.ok()) return outcome;
    if (i == count) {  // this one comes damaged
      unit->bytes.resize(unit->bytes.size() / 2);
      outcome.after_noise = (*decoder)->decode(unit->bytes).status();
      break;
    }
    const auto frame = (*decoder)->decode(unit->bytes);
    if (!frame.ok() || frame->frame != first + i || psnr(view_of(original), frame->picture) < 25)
      return outcome;
    ++outcome.decoded;
  }
  return outcome;
}

TEST(CodecThreads, StreamsDoNotDisturbEachOther) {
  constexpr uint32_t kThreads = 3, kFrames = 20;
  std::vector<Outcome> outcomes(kThreads);
  {
    std::vector<std::jthread> threads;
    for (uint32_t t = 0; t < kThreads; ++t)
      threads.emplace_back([t, &outcomes] { outcomes[t] = run_stream(1000 * t, kFrames); });
  }
  for (const Outcome& outcome : outcomes) {
    EXPECT_EQ(outcome.decoded, kFrames);
    EXPECT_EQ(outcome.after_noise.code(), absl::StatusCode::kInvalidArgument) << outcome.after_noise;
  }
}

// Encoder and decoder share a picture out among threads of their own.
TEST(CodecThreads, JpegTilesAreWorkedOnSideBySide) {
  constexpr uint32_t kWidth = 512, kHeight = 1024;  // two tiles
  auto encoder = JpegEncoder::create(kWidth, kHeight);
  ASSERT_TRUE(encoder.ok());
  JpegDecoder decoder(kWidth, kHeight);
  for (FrameNumber n = 0; n < 3; ++n) {
    const YuvImage original = atlas_picture(kWidth, kHeight, n, 20);
    const auto unit = (*encoder)->encode(n, view_of(original), 1e6, false);
    ASSERT_TRUE(unit.ok()) << unit.status();
    const auto frame = decoder.decode(unit->bytes);
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_GT(psnr(view_of(original), frame->picture), 30);
  }
}

}  // namespace
}  // namespace tessera::codec
