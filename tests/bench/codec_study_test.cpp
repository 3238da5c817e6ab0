#include "bench/codec_study.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "silent_run.h"

namespace tessera::bench {
namespace {

TEST(CodecStudy, EmptySquaresAreSparedByJpegAndEveryRowIsFilledIn) {
  CodecStudySettings settings;
  settings.common.scene = "gallery:0";
  settings.common.size = {320, 180};
  settings.mtexels = {1};
  settings.rounds = 1;
  const auto result = run_silently(run_codec_study, settings);
  ASSERT_TRUE(result.ok()) << result.status();
  ASSERT_EQ(result->rows.size(), 4u);
  for (const CodecRow& row : result->rows) {
    EXPECT_GT(row.encode_ms_per_mtexel.p50, 0);
    EXPECT_GT(row.decode_ms_per_mtexel.p50, 0);
    EXPECT_GT(row.ssim, 0.8);
    EXPECT_GT(row.psnr, 25);
    EXPECT_LE(row.bits_per_sample, 0.5 * 1.1);
    EXPECT_EQ(row.equal_quality_share.has_value(), row.fill < 1);
    if (row.codec == AtlasCodec::jpeg && row.fill < 1) {
      EXPECT_LT(*row.equal_quality_share, 0.55);
    }
  }
  ASSERT_EQ(result->pictures.size(), 2u);
  for (const CodecPictureRow& row : result->pictures) {
    EXPECT_GT(row.mssim, 0.8);
    EXPECT_LE(row.mbits, 0.5 * (1 << 20) / 1e6 * (row.codec == AtlasCodec::jpeg ? 1 : 1.5));
    EXPECT_GT(row.truth_coded, 0.8);
    EXPECT_GT(row.truth_uncoded, row.truth_coded);
  }
  const nlohmann::json json = to_json(*result);
  EXPECT_EQ(json["rows"].size(), 4u);
  EXPECT_EQ(json["settings"]["mtexels"], settings.mtexels);
}

}  // namespace
}  // namespace tessera::bench
