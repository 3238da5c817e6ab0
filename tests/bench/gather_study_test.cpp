#include "bench/gather_study.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>

#include "bench/file_io.h"
#include "bench/temporary_folder.h"
#include "silent_run.h"

namespace tessera::bench {
namespace {

GatherStudySettings small_study(Size size, uint32_t samples) {
  GatherStudySettings settings;
  settings.common.scene = "gallery:0";
  settings.common.size = size;
  settings.samples = samples;
  settings.rounds = 1;
  settings.texture_mtexels = 1;
  return settings;
}

TEST(GatherStudy, EveryLoadIsShadedOnEveryPath) {
  const auto result = run_silently(run_gather_study, small_study({320, 180}, 20'000));
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_GT(result->covered, 0.5);
  EXPECT_GT(result->forward_ns.median, result->shading_ns.median);
  EXPECT_GT(result->shading_ns.median, 0);
  std::map<std::string, std::map<std::string, std::set<std::string>>> paths;
  for (const GatherRow& row : result->rows) {
    paths[row.group][row.name].insert(row.path);
    EXPECT_GT(row.samples, 0u) << row.group << row.name;
    EXPECT_GT(row.ns.median, 0) << row.group << row.name;
    EXPECT_GT(row.ratio_shading.median, row.ratio.median) << row.group << row.name;
    if (row.group != "layouts" && row.group != "texels") {
      EXPECT_GE(row.samples, 20'000u) << row.group << row.name;
      EXPECT_LT(row.samples, 20'000u + 2 * 128 * 128) << row.group << row.name;
    }
    EXPECT_EQ(row.group == "halves", row.outside.has_value() && row.slant > 0);
    if (row.outside) {
      EXPECT_GT(*row.outside, 0);
      EXPECT_LT(*row.outside, 0.5);
    }
  }
  EXPECT_EQ(paths["blocks"].size(), 7u);
  EXPECT_EQ(paths["l"].size(), 7u);
  EXPECT_EQ(paths["layouts"].size(), 3u);
  for (const auto& [group, by_name] : paths)
    for (const auto& [name, on] : by_name)
      // Tessellation shades no blocks; layouts are also shaded automatically.
      EXPECT_EQ(on.size(), group == "texels"       ? 1u
                           : group == "blocks"     ? 2u
                           : name == "tessellated" ? 4u
                                                   : 3u)
          << group << name;
  EXPECT_GT(result->texel_tiles, 0u);
  EXPECT_GT(result->texel_samples, result->texel_tiles);
  EXPECT_GT(result->costs_ms, 0);

  const TemporaryFolder folder;
  ASSERT_TRUE(write_gather_report(folder.path().string(), *result).ok());
  EXPECT_TRUE(read_file(folder.path() / "gather.html").ok());
  const auto json = read_file(folder.path() / "gather.json");
  ASSERT_TRUE(json.ok()) << json.status();
  EXPECT_EQ(nlohmann::json::parse(*json).at("rows").size(), result->rows.size());
  EXPECT_NE(to_text(*result).find("texel shading of the whole picture"), std::string::npos);
}

TEST(GatherStudy, OnlyTheGroupsThatWereAskedFor) {
  GatherStudySettings settings = small_study({160, 90}, 2'000);
  settings.groups = {"l"};
  const auto result = run_silently(run_gather_study, settings);
  ASSERT_TRUE(result.ok()) << result.status();
  ASSERT_FALSE(result->rows.empty());
  for (const GatherRow& row : result->rows) EXPECT_EQ(row.group, "l");
  EXPECT_EQ(result->texel_tiles, 0u);
  EXPECT_EQ(result->costs_ms, 0);
}

TEST(GatherStudy, SpreadsAreQuartiles) {
  const Spread s = spread_of({5, 1, 4, 2, 3});
  EXPECT_EQ(s.low, 2);
  EXPECT_EQ(s.median, 3);
  EXPECT_EQ(s.high, 4);
}

}  // namespace
}  // namespace tessera::bench
