#include "pvs/retention.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <limits>

namespace tessera::pvs {
namespace {

// Too large to stay longer than others.
constexpr float kLarge = 1e6f;

scene::VisiblePatches seen(std::initializer_list<scene::PatchId> patches, float size = kLarge) {
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
  r.update(0, seen({1}, 2 * kLarge));
  EXPECT_EQ(r.update(10, seen({1}, kLarge))[0].footprint.u_px, kLarge);
  EXPECT_EQ(r.update(20, seen({}))[0].footprint.u_px, kLarge);
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

// The longest that a patch of this area stays, in seconds.
double stay_s(float area_px2, DurationNs keep_ns) {
  Retention r(keep_ns);
  r.update(0, {{1, {1, 1, area_px2}}});
  DurationNs low = 0, high = from_seconds(1e4);
  while (high - low > 1) {
    const DurationNs middle = (low + high) / 2;
    Retention copy = r;
    (copy.update(middle, {}).empty() ? high : low) = middle;
  }
  return to_seconds(low);
}

TEST(Retention, ASmallPatchStaysLonger) {
  constexpr DurationNs kKeep = from_ms(100);
  for (const float area : {0.0f, 0.01f, 1.0f, 8.0f}) EXPECT_NEAR(stay_s(area, kKeep), 1, 1e-6) << area;
  EXPECT_NEAR(stay_s(16, kKeep), 0.5, 1e-6);
  EXPECT_NEAR(stay_s(40, kKeep), 0.2, 1e-6);
  for (const float area : {80.0f, 1e4f, 1e30f}) EXPECT_NEAR(stay_s(area, kKeep), 0.1, 1e-6) << area;
  EXPECT_NEAR(stay_s(1, from_seconds(3)), 3, 1e-6) << "never shorter than others";
}

TEST(Retention, AreasThatAreNoNumbersStayAsLongAsOthers) {
  for (const float area : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()})
    EXPECT_NEAR(stay_s(area, from_ms(100)), 0.1, 1e-6) << area;
}

// Against the definition, patch by patch.
TEST(Retention, MatchesTheDefinitionOnRandomSets) {
  constexpr uint32_t kPatches = 50;
  constexpr DurationNs kFrame = from_ms(10), kKeep = 3 * kFrame;
  Retention r(kKeep);
  std::vector<TimeNs> last(kPatches, from_seconds(-100));
  uint32_t random = 1;
  for (TimeNs t = 0; t < 500 * kFrame; t += kFrame) {
    scene::VisiblePatches now;
    for (uint32_t p = 0; p < kPatches; ++p) {
      random = random * 1664525u + 1013904223u;
      if (random >> 28 != 0) continue;
      // Every other one is small enough to stay for ten frames.
      now.push_back({p, {1, 1, p % 2 ? 80.0f : 1e6f}});
      last[p] = t;
    }
    std::vector<scene::PatchId> want;
    for (uint32_t p = 0; p < kPatches; ++p) {
      if (t - last[p] <= (p % 2 ? 10 * kFrame : kKeep)) want.push_back(p);
    }
    ASSERT_EQ(ids(r.update(t, now)), want) << "at " << t;
  }
}

}  // namespace
}  // namespace tessera::pvs
