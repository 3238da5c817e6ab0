#include "codec/video_encoder.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>

#include "codec/annex_b.h"
#include "codec/video_decoder.h"
#include "codec/yuv.h"
#include "pictures.h"

namespace tessera::codec {
namespace {

constexpr double kMbps = 1e6;

std::unique_ptr<VideoEncoder> make_encoder(uint32_t width, uint32_t height, double bitrate) {
  auto encoder =
      VideoEncoder::create({.width = width, .height = height, .bitrate_bps = bitrate, .encoder = "x264"});
  EXPECT_TRUE(encoder.ok()) << encoder.status();
  return *std::move(encoder);
}

double bits(const AccessUnit& unit) {
  return 8.0 * static_cast<double>(unit.bytes.size());
}

TEST(VideoEncoder, RefusesSettingsOutsideTheirRange) {
  const EncoderSettings good{.width = 64, .height = 64};
  const auto code = [](const EncoderSettings& s) { return VideoEncoder::create(s).status().code(); };
  for (auto change : std::initializer_list<void (*)(EncoderSettings&)>{
           [](EncoderSettings& s) { s.width = 0; }, [](EncoderSettings& s) { s.width = 63; },
           [](EncoderSettings& s) { s.height = 65; }, [](EncoderSettings& s) { s.height = 1u << 20; },
           [](EncoderSettings& s) { s.frames_per_second = 0; },
           [](EncoderSettings& s) { s.frames_per_second = NAN; },
           [](EncoderSettings& s) { s.bitrate_bps = -1; }, [](EncoderSettings& s) { s.bitrate_bps = 1e12; },
           [](EncoderSettings& s) { s.encoder = "theora"; }}) {
    EncoderSettings s = good;
    change(s);
    EXPECT_EQ(code(s), absl::StatusCode::kInvalidArgument);
  }
  EncoderSettings vaapi = good;
  vaapi.encoder = "vaapi";
  EXPECT_EQ(code(vaapi), absl::StatusCode::kUnavailable);
  EncoderSettings preset = good;
  preset.encoder = "x264";
  preset.preset = "no-such-preset";
  EXPECT_FALSE(VideoEncoder::create(preset).ok());
}

TEST(VideoEncoder, ProbingSaysWhatRunsAndWhy) {
  auto encoder = VideoEncoder::create({.width = 64, .height = 64});
  ASSERT_TRUE(encoder.ok()) << encoder.status();
  const std::string& choice = (*encoder)->choice();
  if (choice.find("nvenc") == 0) GTEST_SKIP() << choice;
  EXPECT_EQ(choice.find("libx264 (no NVENC: "), 0u) << choice;
  EXPECT_NE(choice.find("no VAAPI: "), std::string::npos) << choice;
}

TEST(VideoEncoder, OnlyAskedForFramesAreKeyFramesAndTheFirstAlwaysIs) {
  auto encoder = make_encoder(128, 64, 1 * kMbps);
  for (uint32_t frame = 0; frame < 40; ++frame) {
    // Every tenth picture is a hard cut: still no key frame by itself.
    const YuvImage picture = frame % 10 == 9 ? noise_picture(128, 64, frame) : atlas_picture(128, 64, 0, 0);
    const bool asked = frame == 17 || frame == 18 || frame == 30;
    auto unit = encoder->encode(frame, view_of(picture), asked ? 120000 : 30000, asked);
    ASSERT_TRUE(unit.ok()) << unit.status();
    EXPECT_EQ(unit->key_frame, asked || frame == 0) << frame;
    const AccessUnitInfo info = inspect(unit->bytes);
    EXPECT_EQ(info.key_frame, unit->key_frame);
    ASSERT_TRUE(info.tag.has_value());
    EXPECT_EQ(info.tag->frame, frame);
    EXPECT_EQ(info.tag->reference, unit->key_frame ? frame : frame - 1);
  }
}

enum class Content { still, churn, noise, cuts };

struct BudgetCase {
  uint32_t width, height;
  Content content;
  double bitrate;
  bool vary;  // budgets jump between 30 % and 100 % from frame to frame
  int frames;
};

YuvImage picture_of(const BudgetCase& c, uint32_t frame) {
  switch (c.content) {
    case Content::still:
      return atlas_picture(c.width, c.height, 0, 0);
    case Content::churn:
      return atlas_picture(c.width, c.height, frame, 10);
    case Content::noise:
      return noise_picture(c.width, c.height, frame);
    case Content::cuts:
      break;
  }
  return frame / 4 % 2 ? noise_picture(c.width, c.height, frame) : atlas_picture(c.width, c.height, frame, 0);
}

class Budgets : public testing::TestWithParam<BudgetCase> {};

TEST_P(Budgets, NoFrameExceedsItsOwnByMoreThanATenth) {
  const BudgetCase c = GetParam();
  auto encoder = make_encoder(c.width, c.height, c.bitrate);
  std::mt19937 random(5);
  double used = 0, given = 0;
  for (int frame = 0; frame < c.frames; ++frame) {
    const bool key = frame == 0 || frame == 2 * c.frames / 3;
    double budget = c.bitrate / 30 * (key ? 4 : 1);
    if (c.vary) budget *= 0.3 + 0.7 * (random() % 1000) / 999;
    const YuvImage picture = picture_of(c, static_cast<uint32_t>(frame));
    auto unit = encoder->encode(static_cast<uint32_t>(frame), view_of(picture), budget, key);
    ASSERT_TRUE(unit.ok()) << unit.status();
    EXPECT_LE(bits(*unit), 1.1 * budget) << "frame " << frame;
    used += bits(*unit);
    given += budget;
  }
  // Content that needs more than there is must also use what there is.
  if (c.content == Content::noise && !c.vary) {
    EXPECT_GT(used, 0.6 * given);
  }
}

INSTANTIATE_TEST_SUITE_P(All, Budgets,
                         testing::Values(BudgetCase{2048, 1024, Content::still, 18 * kMbps, false, 6},
                                         BudgetCase{2048, 1024, Content::cuts, 18 * kMbps, true, 10},
                                         BudgetCase{2048, 1024, Content::noise, 18 * kMbps, true, 6},
                                         BudgetCase{512, 256, Content::still, 1.2 * kMbps, true, 30},
                                         BudgetCase{512, 256, Content::churn, 1.2 * kMbps, false, 30},
                                         BudgetCase{512, 256, Content::churn, 1.2 * kMbps, true, 30},
                                         BudgetCase{512, 256, Content::noise, 1.2 * kMbps, false, 30},
                                         BudgetCase{512, 256, Content::noise, 1.2 * kMbps, true, 30},
                                         BudgetCase{512, 256, Content::cuts, 1.2 * kMbps, false, 30},
                                         BudgetCase{512, 256, Content::cuts, 1.2 * kMbps, true, 30},
                                         BudgetCase{64, 64, Content::noise, 0.3 * kMbps, true, 60},
                                         BudgetCase{130, 34, Content::churn, 0.2 * kMbps, true, 60}));

TEST(VideoEncoder, AStillPictureConvergesAndThenCostsNextToNothing) {
  auto encoder = make_encoder(512, 256, 1.2 * kMbps);
  auto decoder = VideoDecoder::create();
  ASSERT_TRUE(decoder.ok()) << decoder.status();
  const YuvImage picture = atlas_picture(512, 256, 0, 0);
  double first = 0, last = 0, last_bits = 0;
  for (uint32_t frame = 0; frame < 45; ++frame) {
    auto unit = encoder->encode(frame, view_of(picture), frame == 0 ? 160000 : 40000, frame == 0);
    ASSERT_TRUE(unit.ok()) << unit.status();
    auto decoded = (*decoder)->decode(unit->bytes);
    ASSERT_TRUE(decoded.ok()) << decoded.status();
    last = psnr(view_of(picture), decoded->picture);
    last_bits = bits(*unit);
    if (frame == 0) first = last;
  }
  EXPECT_GT(last, first + 6);
  EXPECT_GT(last, 44);
  EXPECT_LT(last_bits, 8000);
}

TEST(VideoEncoder, RefusesPicturesAndBudgetsThatMakeNoSense) {
  auto encoder = make_encoder(64, 64, kMbps);
  const YuvImage picture = noise_picture(64, 64, 1), other = noise_picture(32, 64, 1);
  EXPECT_EQ(encoder->encode(0, view_of(other), 1e5, true).status().code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(encoder->encode(0, view_of(picture), 0, true).status().code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(encoder->encode(0, view_of(picture), NAN, true).status().code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_TRUE(encoder->encode(0, view_of(picture), 1e5, true).ok());
}

// What another program reads from the stream. An empty string if there is no ffprobe.
std::string ffprobe(const std::filesystem::path& file, const std::string& arguments) {
  const std::string command =
      "ffprobe -v error -of default=noprint_wrappers=1 " + arguments + " '" + file.string() + "' 2>&1";
  std::string output;
  FILE* pipe = popen(command.c_str(), "r");
  if (!pipe) return output;
  char chunk[4096];
  while (const size_t n = fread(chunk, 1, sizeof(chunk), pipe)) output.append(chunk, n);
  return pclose(pipe) == 0 ? output : std::string();
}

TEST(VideoEncoder, AnIndependentReaderAgreesOnTheStream) {
  auto encoder = make_encoder(208, 122, 1 * kMbps);  // not a multiple of 16: cropped
  const auto file = std::filesystem::path(testing::TempDir()) /
                    ("tessera_codec_" + std::to_string(std::random_device{}()) + ".h264");
  std::ofstream out(file, std::ios::binary);
  for (uint32_t frame = 0; frame < 20; ++frame) {
    const YuvImage picture = atlas_picture(208, 122, frame, 20);
    auto unit = encoder->encode(frame, view_of(picture), 33000, frame % 9 == 0);
    ASSERT_TRUE(unit.ok()) << unit.status();
    out.write(reinterpret_cast<const char*>(unit->bytes.data()),
              static_cast<std::streamsize>(unit->bytes.size()));
  }
  out.close();
  const std::string stream = ffprobe(file,
                                     "-show_entries "
                                     "stream=width,height,pix_fmt,color_range,color_space,color_transfer,"
                                     "color_primaries,has_b_frames,refs,profile,chroma_location");
  const std::string frames = ffprobe(file, "-show_entries frame=pict_type,key_frame");
  std::filesystem::remove(file);
  if (stream.empty()) GTEST_SKIP() << "ffprobe is not installed";
  for (const char* line : {"width=208\n", "height=122\n", "pix_fmt=yuv420p\n", "color_range=tv\n",
                           "color_space=bt709\n", "color_transfer=bt709\n", "color_primaries=bt709\n",
                           "has_b_frames=0\n", "refs=1\n", "profile=High\n", "chroma_location=center\n"})
    EXPECT_NE(stream.find(line), std::string::npos) << line << stream;
  EXPECT_EQ(frames.find("pict_type=B"), std::string::npos);
  size_t keys = 0, pictures = 0;
  for (size_t at = 0; (at = frames.find("key_frame=", at)) != std::string::npos; at += 10) {
    ++pictures;
    keys += frames[at + 10] == '1';
  }
  EXPECT_EQ(pictures, 20u);
  EXPECT_EQ(keys, 3u);
}

TEST(VideoEncoder, EntropyCodingIsCavlc) {
  auto encoder = make_encoder(64, 64, kMbps);
  const YuvImage picture = atlas_picture(64, 64, 0, 0);
  auto unit = encoder->encode(0, view_of(picture), 1e5, true);
  ASSERT_TRUE(unit.ok()) << unit.status();
  for (Nal nal : split_nals(unit->bytes))
    if (type_of(nal) == NalType::pps) {
      // pic_parameter_set_id = 0 and seq_parameter_set_id = 0 take a bit each; then entropy_coding_mode_flag.
      EXPECT_EQ(nal[1] >> 6, 3);
      EXPECT_EQ((nal[1] >> 5) & 1, 0);
      return;
    }
  FAIL() << "a key frame without picture parameter set";
}

}  // namespace
}  // namespace tessera::codec
