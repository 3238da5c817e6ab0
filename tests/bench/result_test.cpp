#include "bench/result.h"

#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>

#include "sample_result.h"

namespace tessera::bench {
namespace {

TEST(Percentiles, OfKnownValues) {
  std::vector<double> values(101);
  for (int i = 0; i <= 100; ++i) values[i] = 100 - i;
  const Percentiles p = percentiles(values);
  EXPECT_DOUBLE_EQ(p.p50, 50);
  EXPECT_DOUBLE_EQ(p.p95, 95);
  EXPECT_DOUBLE_EQ(p.p99, 99);
  EXPECT_DOUBLE_EQ(percentiles({1, 2}).p50, 1.5);
  EXPECT_DOUBLE_EQ(percentiles({7}).p99, 7);
  EXPECT_DOUBLE_EQ(percentiles({}).p95, 0);
}

TEST(Result, JsonHasEveryFieldOfTheSchema) {
  const nlohmann::json j = to_json(sample_result());
  for (const char* field :
       {"schema", "command", "commit", "machine", "device", "settings", "rows", "split", "frames"}) {
    EXPECT_TRUE(j.contains(field)) << field;
  }
  EXPECT_EQ(j["schema"], "tessera.bench.v1");
  const nlohmann::json& row = j["rows"][0];
  for (const char* field : {"mssim",
                            "dssim",
                            "psnr",
                            "psnr_rgb",
                            "ssim7",
                            "holes",
                            "linf",
                            "mbps_total",
                            "mbps_atlas",
                            "mbps_meta",
                            "frames_displayed",
                            "frames_stale",
                            "frames_lost",
                            "violations",
                            "durations_ms",
                            "end_to_end_ms",
                            "tiling_error_ms_max",
                            "server_ms",
                            "client_ms",
                            "samples_shaded",
                            "coverage",
                            "overestimation",
                            "peak_rss_mib",
                            "device_mib"}) {
    EXPECT_TRUE(row.contains(field)) << field;
  }
  EXPECT_EQ(row["durations_ms"]["downlink"]["p95"], 70);
  EXPECT_DOUBLE_EQ(row["dssim"], (1 - 0.96) / 2);
  EXPECT_DOUBLE_EQ(row["mssim_masked"], 0.8765);
  EXPECT_FALSE(j["rows"][1].contains("mssim_masked"));
  EXPECT_FALSE(j["rows"][1].contains("violations")) << "nobody has looked for them";
  EXPECT_FALSE(j["rows"][1].contains("holes"));  // a baseline has no visible set
  EXPECT_EQ(j["settings"]["size"], "960x540");
  EXPECT_EQ(j["frames"].size(), 60u);
  EXPECT_GT(j["machine"]["cores"], 0);
  EXPECT_GT(j["machine"]["memory_mib"], 0);
}

TEST(Result, JsonSurvivesValuesThatAreNoNumbers) {
  LoopbackResult result = sample_result();
  result.rows[0].error.psnr = std::numeric_limits<double>::quiet_NaN();
  const nlohmann::json read = nlohmann::json::parse(to_json(result).dump());
  EXPECT_TRUE(read["rows"][0]["psnr"].is_null());
}

TEST(Result, PeakMemoryIsThatOfARunningProcess) {
  EXPECT_GT(peak_rss_mib(), 1);
  EXPECT_LT(peak_rss_mib(), 1e6);
}

}  // namespace
}  // namespace tessera::bench
