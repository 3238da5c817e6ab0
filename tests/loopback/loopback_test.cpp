// The whole chain on a small procedural scene. What it checks holds for every scene; figures belong to
// `tessera-bench`.
#include "bench/loopback.h"

#include <gtest/gtest.h>

#include "../bench/silent_run.h"
#include "bench/result.h"

namespace tessera::bench {
namespace {

LoopbackSettings small(double seconds) {
  LoopbackSettings s;
  s.scene = "gallery:0";
  s.seconds = seconds;
  s.size = {320, 180};
  s.atlas = {1024, 512};
  s.bitrate_mbps = 10;
  s.truth_cache = "none";
  s.baselines = {"none"};
  s.validation = true;
  return s;
}

LoopbackResult run(const LoopbackSettings& settings) {
  auto result = run_silently(run_loopback, settings);
  EXPECT_TRUE(result.ok()) << result.status();
  return *std::move(result);
}

TEST(Loopback, TheClientShowsWhatTheServerMeant) {
  const LoopbackResult result = run(small(0.5));
  ASSERT_EQ(result.rows.size(), 1u);
  const Row& row = result.rows[0];
  EXPECT_EQ(row.frames_displayed, 30u);
  EXPECT_EQ(result.frames.size(), 30u);
  EXPECT_EQ(row.violations, 0u) << "looked for, and none";
  EXPECT_LE(*row.tiling_error_ms_max, 1.0);
  EXPECT_LT(*row.holes, 0.02);
  EXPECT_GT(*row.coverage, *row.coverage_without_prediction);
  EXPECT_GT(row.error.mssim, 0.8);
  EXPECT_LE(row.mbps_total, 10 * 1.3);
}

TEST(Loopback, EveryLayoutShowsTheScene) {
  for (const atlas::LayoutKind layout :
       {atlas::LayoutKind::blocks, atlas::LayoutKind::coherent, atlas::LayoutKind::tessellated}) {
    LoopbackSettings s = small(0.2);
    s.layout = layout;
    const LoopbackResult result = run(s);
    EXPECT_EQ(result.rows.at(0).violations, 0u);
    EXPECT_GT(result.rows[0].error.mssim, 0.8);
  }
}

TEST(Loopback, SplitAddsUpAndEachCauseOnlyRemovesError) {
  const LoopbackResult result = run(small(0.3));
  ASSERT_EQ(result.split.size(), 5u);
  double sum = 0;
  for (const SplitRow& row : result.split) sum += row.added;
  EXPECT_NEAR(sum, 1 - result.rows[0].error.mssim, 1e-9);
  EXPECT_GE(result.split[0].added, -0.01) << "coding";
  EXPECT_GE(result.split[4].added, 0) << "sampling";
}

TEST(Loopback, TheSameSettingsGiveTheSamePictures) {
  LoopbackSettings s = small(0.2);
  s.split = false;
  const LoopbackResult a = run(s), b = run(s);
  ASSERT_EQ(a.frames.size(), b.frames.size());
  for (size_t i = 0; i < a.frames.size(); ++i) {
    EXPECT_EQ(a.frames[i].mssim, b.frames[i].mssim) << i;
    EXPECT_EQ(a.frames[i].atlas_bytes, b.frames[i].atlas_bytes) << i;
    EXPECT_EQ(a.frames[i].meta_bytes, b.frames[i].meta_bytes) << i;
  }
}

TEST(Loopback, ALossyLinkStillKeepsPairsWhole) {
  LoopbackSettings s = small(0.5);
  s.split = false;
  s.loss = 0.05;
  s.jitter_ms = 20;
  const LoopbackResult result = run(s);
  EXPECT_EQ(result.rows[0].violations, 0u);
  EXPECT_EQ(result.rows[0].frames_displayed, 30u);
}

TEST(Loopback, JpegKeepsItsBudgetAndPairsStayWhole) {
  LoopbackSettings s = small(0.15);
  s.codec = AtlasCodec::jpeg;
  const LoopbackResult result = run(s);
  const Row& row = result.rows[0];
  EXPECT_EQ(row.violations, 0u);
  EXPECT_GT(row.error.mssim, 0.8);
  EXPECT_LE(row.mbps_total, 10 * 1.1) << "no key frames that cost more";
  EXPECT_LT(result.split[0].added, 0.1) << "coding";
}

TEST(Loopback, RawHasNoCodingError) {
  LoopbackSettings s = small(0.05);
  s.codec = AtlasCodec::raw;
  s.bitrate_mbps = 500;
  const LoopbackResult result = run(s);
  EXPECT_EQ(result.rows[0].violations, 0u);
  EXPECT_EQ(result.split[0].cause, "coding");
  EXPECT_EQ(result.split[0].added, 0);
}

TEST(Loopback, AMissingSceneNamesTheFile) {
  LoopbackSettings s = small(0.1);
  s.scene = "no/such/scene.glb";
  const auto result = run_silently(run_loopback, s);
  ASSERT_FALSE(result.ok());
  EXPECT_NE(std::string(result.status().message()).find("no/such/scene.glb"), std::string::npos);
}

}  // namespace
}  // namespace tessera::bench
