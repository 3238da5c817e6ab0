// The device's own tessellator against atlas/addressing.
#include "shading/tessellator.h"

#include <gmock/gmock.h>

#include "atlas/addressing/addressing.h"
#include "test_world.h"

namespace tessera::shading::test {
namespace {

namespace addressing = atlas::addressing;

std::vector<TrialMarks> marks_of(std::span<const Trial> trials) {
  auto marks = run_tessellator(device(), trials);
  EXPECT_TRUE(marks.ok()) << marks.status();
  return marks.ok() ? *std::move(marks) : std::vector<TrialMarks>(trials.size());
}

TEST(Tessellator, FillsTheLOfEveryLevelOnce) {
  std::vector<Trial> trials;
  for (int level = 1; level <= addressing::kMaxTessellationLevel; ++level) trials.push_back({.level = level});
  const auto all = marks_of(trials);
  for (size_t i = 0; i < trials.size(); ++i) {
    const int level = trials[i].level, side = level + 1;
    EXPECT_EQ(all[i].evaluations, static_cast<uint32_t>(addressing::tessellation_vertices(level))) << level;
    EXPECT_EQ(all[i].elsewhere, 0u) << level;
    ASSERT_EQ(all[i].places.size(), static_cast<size_t>(side * side));
    for (int k = 0; k < side * side; ++k) {
      const addressing::ivec2 texel(k % side, k / side);
      ASSERT_EQ(all[i].places[static_cast<size_t>(k)], addressing::l_contains(texel, level) ? 1u : 0u)
          << "level " << level << " at " << texel.x << "," << texel.y;
    }
    EXPECT_TRUE(fits(trials[i], all[i]));
  }
}

TEST(Tessellator, NumbersEverySampleOnce) {
  std::vector<Trial> trials;
  for (int samples = 3; samples <= addressing::kMaxTessellationVertices; ++samples)
    trials.push_back({.samples = samples});
  const auto all = marks_of(trials);
  for (size_t i = 0; i < trials.size(); ++i) {
    EXPECT_EQ(all[i].evaluations, static_cast<uint32_t>(trials[i].samples));
    EXPECT_EQ(all[i].elsewhere, 0u) << trials[i].samples;
    ASSERT_EQ(all[i].places.size(), static_cast<size_t>(trials[i].samples));
    ASSERT_THAT(all[i].places, testing::Each(1u)) << trials[i].samples << " samples";
  }
}

TEST(Tessellator, AnLFitsIfItIsFullAndNothingElseIs) {
  const Trial trial{.level = 6};
  TrialMarks marks = marks_of({&trial, 1}).front();
  ASSERT_TRUE(fits(trial, marks));
  ++marks.places[0];  // evaluated twice
  EXPECT_TRUE(fits(trial, marks));
  marks.places[0] = 0;
  EXPECT_FALSE(fits(trial, marks)) << "a hole";
  marks.places[0] = 1;
  marks.places.back() = 1;  // the corner that no L has
  EXPECT_FALSE(fits(trial, marks));
  marks.places.back() = 0;
  marks.elsewhere = 1;
  EXPECT_FALSE(fits(trial, marks));
}

TEST(Tessellator, SamplesFitIfEachIsThere) {
  const Trial trial{.samples = 20};
  TrialMarks marks = marks_of({&trial, 1}).front();
  ASSERT_TRUE(fits(trial, marks));
  marks.places[7] = 0;
  EXPECT_FALSE(fits(trial, marks));
}

TEST(Tessellator, RefusesTrialsOutOfRange) {
  for (const Trial& trial : {Trial{.level = 65}, Trial{.level = -1}, Trial{.samples = 2},
                             Trial{.samples = addressing::kMaxTessellationVertices + 1}})
    EXPECT_EQ(run_tessellator(device(), {&trial, 1}).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(Tessellator, TheSoftwareDevicePassesTheCheck) {
  const Status status = check_tessellator(device());
  EXPECT_TRUE(status.ok()) << status;
}

// Parts of a block with more samples than a triangle can have are a triangle's each.
TEST(Tessellator, PartsOfManySamplesAreTrianglesOwn) {
  const addressing::ivec2 largest(addressing::kMaxHalfWidth, addressing::kMaxHalfLength);
  for (int samples = 3; samples <= addressing::staircase_samples(largest); ++samples) {
    const int part = addressing::oversampling_part(samples);
    const int last = samples - (samples - 1) / part * part;
    ASSERT_TRUE(part <= addressing::kMaxTessellationVertices && last >= 3 && last <= part) << samples;
  }
}

}  // namespace
}  // namespace tessera::shading::test
