#include "pvs/retention.h"

#include <gmock/gmock.h>

#include <algorithm>

namespace tessera::pvs {
namespace {

scene::VisiblePatches seen(std::initializer_list<scene::PatchId> patches, float size = 1) {
  scene::VisiblePatches out;
  for (const scene::PatchId p : patches) out.push_back({p, {size, size, size * size}});
  return out;
}

std::vector<scene::PatchId> ids(const scene::VisiblePatches& patches) {
  std::vector<scene::PatchId> out;
  for (const auto& p : patches) out.push_back(p.patch);
  return out;
}

using testing::ElementsAre;
using testing::IsEmpty;

TEST(Retention, KeepsAPatchForExactlyItsTime) {
  Retention r(100);
  r.update(0, seen({3, 7}));
  EXPECT_THAT(ids(r.update(50, seen({7}))), ElementsAre(3, 7));
  EXPECT_THAT(ids(r.update(100, seen({}))), ElementsAre(3, 7));
  EXPECT_THAT(ids(r.update(101, seen({}))), ElementsAre(7));
  EXPECT_THAT(ids(r.update(151, seen({}))), IsEmpty());
}

TEST(Retention, SeeingAPatchAgainRestartsItsTime) {
  Retention r(100);
  r.update(0, seen({1}));
  r.update(90, seen({1}));
  EXPECT_THAT(ids(r.update(190, seen({}))), ElementsAre(1));
  EXPECT_THAT(ids(r.update(191, seen({}))), IsEmpty());
}

TEST(Retention, UsesTheLastFootprintSeen) {
  Retention r(100);
  r.update(0, seen({1}, 4));
  EXPECT_EQ(r.update(10, seen({1}, 2))[0].footprint.u_px, 2);
  EXPECT_EQ(r.update(20, seen({}))[0].footprint.u_px, 2);
}

TEST(Retention, ZeroTimeKeepsOnlyWhatIsSeen) {
  Retention r(0);
  r.update(0, seen({1, 2}));
  EXPECT_THAT(ids(r.update(1, seen({2, 3}))), ElementsAre(2, 3));
}

TEST(Retention, AClockThatJumpsBackKeepsNothingForEver) {
  Retention r(100);
  r.update(1'000'000, seen({5}));
  EXPECT_THAT(ids(r.update(0, seen({}))), ElementsAre(5));
  EXPECT_THAT(ids(r.update(101, seen({}))), IsEmpty());
}

TEST(Retention, TheLastPatchIdIsKeptToo) {
  Retention r(100);
  r.update(0, seen({0, 0xffffffffu}));
  EXPECT_THAT(ids(r.update(1, seen({}))), ElementsAre(0u, 0xffffffffu));
}

// Against the definition, patch by patch.
TEST(Retention, MatchesTheDefinitionOnRandomSets) {
  constexpr uint32_t kPatches = 50;
  constexpr DurationNs kKeep = 3;
  Retention r(kKeep);
  std::vector<TimeNs> last(kPatches, -1000);
  uint32_t random = 1;
  for (TimeNs t = 0; t < 500; ++t) {
    scene::VisiblePatches now;
    for (uint32_t p = 0; p < kPatches; ++p) {
      random = random * 1664525u + 1013904223u;
      if (random >> 30 != 0) continue;
      now.push_back({p, {}});
      last[p] = t;
    }
    std::vector<scene::PatchId> want;
    for (uint32_t p = 0; p < kPatches; ++p) {
      if (t - last[p] <= kKeep) want.push_back(p);
    }
    ASSERT_EQ(ids(r.update(t, now)), want) << "at " << t;
  }
}

}  // namespace
}  // namespace tessera::pvs
