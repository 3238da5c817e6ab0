#include "pvs/coverage.h"

#include <gmock/gmock.h>

namespace tessera::pvs {
namespace {

scene::VisiblePatch patch(scene::PatchId id, float area) {
  return {id, {1, 1, area}};
}

TEST(Coverage, CountsByArea) {
  const Coverage c = compare({patch(1, 10), patch(3, 20), patch(8, 5)},
                             {patch(1, 12), patch(2, 6), patch(8, 6), patch(9, 6)});
  EXPECT_DOUBLE_EQ(c.seen_area, 30);
  EXPECT_DOUBLE_EQ(c.missed_area, 12);  // 2 and 9, as they were seen
  EXPECT_DOUBLE_EQ(c.extra_area, 20);   // 3, as it was predicted
  EXPECT_DOUBLE_EQ(c.coverage(), 0.6);
  EXPECT_DOUBLE_EQ(c.overestimation(), 20.0 / 30);
}

TEST(Coverage, APerfectSetIsOneAndZero) {
  const scene::VisiblePatches set{patch(0, 1), patch(5, 2), patch(0xffffffffu, 3)};
  const Coverage c = compare(set, set);
  EXPECT_DOUBLE_EQ(c.coverage(), 1);
  EXPECT_DOUBLE_EQ(c.overestimation(), 0);
}

TEST(Coverage, EmptySets) {
  EXPECT_DOUBLE_EQ(compare({}, {}).coverage(), 1);
  EXPECT_DOUBLE_EQ(compare({}, {}).overestimation(), 0);
  EXPECT_DOUBLE_EQ(compare({}, {patch(1, 4)}).coverage(), 0);
  const Coverage nothing_seen = compare({patch(1, 4)}, {});
  EXPECT_DOUBLE_EQ(nothing_seen.coverage(), 1);
  EXPECT_DOUBLE_EQ(nothing_seen.extra_area, 4);
}

TEST(Coverage, ManyTinyAreasAreNotLost) {
  scene::VisiblePatches seen, predicted;
  for (uint32_t i = 0; i < 1'000'000; ++i) seen.push_back(patch(i, i == 0 ? 1e7f : 0.01f));
  predicted.push_back(seen[0]);
  EXPECT_NEAR(compare(predicted, seen).missed_area, 9999.99, 0.01);
}

}  // namespace
}  // namespace tessera::pvs
