#include "bench/spatial.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "bench/file_io.h"
#include "bench/temporary_folder.h"
#include "silent_run.h"

namespace tessera::bench {
namespace {

const SpatialRow& row_of(const SpatialResult& result, const std::string& name, bool bias_off) {
  for (const SpatialRow& row : result.rows)
    if (row.method.name == name && (row.method.bias == 0) == bias_off) return row;
  ADD_FAILURE() << "no row " << name;
  return result.rows.front();
}

TEST(Spatial, ReuseSavesSamples) {
  SpatialSettings settings = default_spatial_settings();
  settings.common.scene = "gallery:0";
  settings.common.size = {480, 270};
  settings.common.atlas = {1024, 1024};
  settings.common.seconds = 1;  // one frame
  settings.common.truth_cache = "none";
  const auto result = run_silently(run_spatial, settings);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->frames, 1u);
  EXPECT_EQ(result->rows.size(), spatial_cases().size());
  for (const SpatialRow& row : result->rows) {
    EXPECT_GT(row.samples, 0) << row.method.name;
    EXPECT_LT(row.holes, 0.001) << row.method.name;
  }
  const SpatialRow& mono = row_of(*result, "mono", true);
  EXPECT_EQ(mono.to_mono, 1);
  EXPECT_EQ(mono.bias, 0);
  EXPECT_LE(row_of(*result, "stereo", true).to_mono, 1.15);
  EXPECT_LT(row_of(*result, "barrel", true).to_mono, 1);
  EXPECT_LT(row_of(*result, "foveated", true).to_mono, 0.9);
  EXPECT_LT(row_of(*result, "foveated x2", true).samples, row_of(*result, "foveated", true).samples);
  EXPECT_GT(row_of(*result, "foveated", true).mssim_center, mono.mssim_center - 0.01) << "where the gaze is";
  EXPECT_GT(row_of(*result, "mono", false).samples, 2 * mono.samples) << "the atlas has room";
  EXPECT_GT(row_of(*result, "mono", false).mssim, mono.mssim);

  const TemporaryFolder folder;
  ASSERT_TRUE(write_spatial_report(folder.path().string(), *result).ok());
  const auto page = read_file(folder.path() / "spatial.html");
  ASSERT_TRUE(page.ok()) << page.status();
  const auto json = read_file(folder.path() / "spatial.json");
  ASSERT_TRUE(json.ok()) << json.status();
  EXPECT_EQ(nlohmann::json::parse(*json).at("rows").size(), result->rows.size());
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "spatial-stereo-bias-off-left-eye-client.png"));
}

TEST(Spatial, DensityPicturesRunFromASixtyFourthToFour) {
  Plane density(4, 1);
  density.values = {0, 1.0f / 64, 4, 1000};
  const Image8 picture = density_picture(density);
  for (int c = 0; c < 3; ++c) {
    EXPECT_EQ(picture.at(0, 0)[c], picture.at(1, 0)[c]);
    EXPECT_EQ(picture.at(2, 0)[c], picture.at(3, 0)[c]);
  }
  EXPECT_GT(picture.at(2, 0)[0], picture.at(1, 0)[0] + 100);
}

}  // namespace
}  // namespace tessera::bench
