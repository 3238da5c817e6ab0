#include "bench/layout_study.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "bench/file_io.h"
#include "bench/temporary_folder.h"
#include "silent_run.h"

namespace tessera::bench {
namespace {

TEST(Interpolate, IsLinearBetweenNeighboursAndSilentBeyond) {
  const std::vector<Point> points{{3, 30}, {1, 10}, {2, 40}};
  EXPECT_EQ(interpolate(points, 1), 10);
  EXPECT_EQ(interpolate(points, 1.5), 25);
  EXPECT_EQ(interpolate(points, 2.5), 35);
  EXPECT_EQ(interpolate(points, 3), 30);
  EXPECT_FALSE(interpolate(points, 0.99));
  EXPECT_FALSE(interpolate(points, 3.01));
  EXPECT_FALSE(interpolate({}, 1));
}

LayoutRow row(const std::string& layout, double samples, double mssim, double kbit, double coded) {
  LayoutRow out{.layout = layout, .width = 512, .height = 256, .samples = samples};
  out.error.mssim = mssim;
  out.atlas_kbit = kbit;
  out.coded.emplace().mssim = coded;
  return out;
}

TEST(CompareLayouts, AtEqualSamplesAndAtEqualError) {
  // Twice the samples halve a's error; b needs as many bits as a for an error between a's two.
  const std::vector<LayoutRow> rows{row("a", 1e6, 0.9, 100, 0.88), row("a", 4e6, 0.96, 400, 0.92),
                                    row("b", 2e6, 0.965, 100, 0.9)};
  const std::vector<LayoutComparison> to_a = compare_layouts(rows, "a");
  ASSERT_EQ(to_a.size(), 1u);
  EXPECT_EQ(to_a[0].layout, "b");
  EXPECT_NEAR(*to_a[0].dssim_ratio, 0.035 / 0.07, 1e-9);
  EXPECT_NEAR(*to_a[0].bits_ratio, 0.5, 1e-9);
  const std::vector<LayoutComparison> to_b = compare_layouts(rows, "b");
  ASSERT_EQ(to_b.size(), 2u);
  EXPECT_FALSE(to_b[0].dssim_ratio) << "one point is no curve";
}

LayoutStudySettings small_study() {
  LayoutStudySettings settings = default_layout_study_settings();
  settings.common.scene = "gallery:0";
  settings.common.size = {240, 136};
  settings.common.seconds = 0.1;
  settings.common.score_every = 1;
  settings.common.truth_cache = "none";
  settings.warm_up_frames = 4;
  return settings;
}

TEST(LayoutStudy, MeasuresEveryLayout) {
  LayoutStudySettings settings = small_study();
  settings.layouts.emplace_back("l-packing");
  settings.layouts.emplace_back("texel-shading");
  settings.texture_mtexels = 16;
  settings.atlases = {{256, 256}, {512, 256}};  // larger ones hold all patches at their finest
  settings.bitrates_mbps = {4};
  const auto result = run_silently(run_layout_study, settings);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->frames, 3u);
  ASSERT_EQ(result->rows.size(), 9u);
  EXPECT_EQ(result->rows[0].layout, "texel-shading");
  EXPECT_GT(*result->rows[0].picture_samples, 240 * 136);
  EXPECT_GT(result->rows[0].samples,
            1.2 * *result->rows[0].picture_samples);  // the predicted views are larger
  EXPECT_GT(result->rows[0].error.mssim, 0.75);
  for (size_t i = 1; i < result->rows.size(); ++i) {
    const LayoutRow& r = result->rows[i];
    EXPECT_EQ(r.layout, settings.layouts[(i - 1) % 4]);
    EXPECT_LE(r.samples, 1.0 * r.width * r.height + r.colors) << r.layout;
    EXPECT_GT(r.fill, 0.2) << r.layout;
    EXPECT_LE(r.fill, 1) << r.layout;
    EXPECT_GT(r.error.mssim, 0.75) << r.layout;
    EXPECT_LE(r.coded->mssim, r.error.mssim + 0.005) << r.layout;
    EXPECT_GT(r.atlas_kbit, 0) << r.layout;
    EXPECT_LT(r.holes, 0.01) << r.layout;
    EXPECT_GT(r.draw_ms.p50, 0) << r.layout;
    EXPECT_EQ(r.outside_share > 0, r.layout == "tessellated");
    if (i > 4) {
      EXPECT_GT(r.samples, result->rows[i - 4].samples) << r.layout;
    }
  }

  const TemporaryFolder folder;
  ASSERT_TRUE(write_layout_report(folder.path().string(), *result).ok());
  const auto json = read_file(folder.path() / "layouts.json");
  ASSERT_TRUE(json.ok()) << json.status();
  EXPECT_EQ(nlohmann::json::parse(*json).at("rows").size(), 9u);
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "layouts.html"));
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "layouts-coherent-512x256-atlas.png"));
}

TEST(LayoutStudy, CodesOneRenderingAtEveryBitRate) {
  LayoutStudySettings settings = small_study();
  settings.layouts = {"coherent"};
  settings.atlases = {{512, 256}};
  settings.bitrates_mbps = {0.1, 4};  // short of what frames at rest take, too
  const auto result = run_silently(run_layout_study, settings);
  ASSERT_TRUE(result.ok()) << result.status();
  ASSERT_EQ(result->rows.size(), 2u);
  const LayoutRow &low = result->rows[0], &high = result->rows[1];
  EXPECT_EQ(low.bitrate_mbps, 0.1);
  EXPECT_EQ(high.bitrate_mbps, 4);
  EXPECT_EQ(low.samples, high.samples);
  EXPECT_EQ(low.meta_kbit, high.meta_kbit);
  EXPECT_EQ(low.error.mssim, high.error.mssim);
  EXPECT_LT(low.atlas_kbit, high.atlas_kbit);
  EXPECT_LE(high.atlas_kbit + high.meta_kbit, 1.1 * 4000 / 30);
  EXPECT_LT(low.coded->mssim, high.coded->mssim);
}

}  // namespace
}  // namespace tessera::bench
