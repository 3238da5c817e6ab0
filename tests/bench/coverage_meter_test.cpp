#include "bench/coverage_meter.h"

#include <gtest/gtest.h>

namespace tessera::bench {
namespace {

scene::VisiblePatches set(std::vector<std::pair<scene::PatchId, float>> patches) {
  scene::VisiblePatches out;
  for (const auto& [patch, area] : patches) out.push_back({patch, {1, 1, area}});
  return out;
}

std::vector<scene::PatchId> ids(const scene::VisiblePatches& patches) {
  std::vector<scene::PatchId> out;
  for (const auto& p : patches) out.push_back(p.patch);
  return out;
}

TEST(Unite, SortedWithTheLargestFootprint) {
  const auto u = unite(set({{1, 5}, {3, 2}}), set({{0, 1}, {3, 9}, {7, 1}}));
  EXPECT_EQ(ids(u), (std::vector<scene::PatchId>{0, 1, 3, 7}));
  EXPECT_EQ(u[2].footprint.area_px2, 9);
}

TEST(CoverageMeter, WeighsWhatWasSeenWithinTheHorizonByArea) {
  CoverageMeter meter;
  meter.add_seen(0, set({{1, 10}}));
  meter.add_frame({.from_ns = 10,
                   .to_ns = 20,
                   .placed = set({{1, 0}, {2, 0}}),
                   .predicted = set({{1, 10}, {5, 4}}),
                   .without_prediction = set({{1, 0}}),
                   .with_true_path = set({{1, 10}, {2, 30}})});
  meter.add_seen(15, set({{1, 10}, {2, 30}}));
  EXPECT_EQ(meter.result().frames, 0u) << "the horizon is not over";
  meter.add_seen(20, set({{1, 10}, {3, 60}}));
  meter.add_seen(30, set({{9, 1000}}));
  const auto result = meter.result();
  EXPECT_EQ(result.frames, 1u);
  EXPECT_DOUBLE_EQ(result.coverage, 0.4);                     // 1 and 2 of 1, 2, 3
  EXPECT_DOUBLE_EQ(result.coverage_without_prediction, 0.1);  // 1 of 1, 2, 3
  EXPECT_DOUBLE_EQ(result.overestimation, 4.0 / 40);          // 5 beside 1 and 2
}

TEST(CoverageMeter, IgnoresFramesOfTheTimeBeforeTheRun) {
  CoverageMeter meter;
  meter.add_frame({.from_ns = 0, .to_ns = 5});
  meter.add_seen(10, set({{1, 1}}));
  meter.add_seen(20, set({{1, 1}}));
  EXPECT_EQ(meter.result().frames, 0u);
}

}  // namespace
}  // namespace tessera::bench
