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
  Retention r;
  r.update(0, 100, seen({3, 7}));
  EXPECT_THAT(ids(r.update(50, 100, seen({7}))), ElementsAre(3, 7));
  EXPECT_THAT(ids(r.update(100, 100, seen({}))), ElementsAre(3, 7));
  EXPECT_THAT(ids(r.update(101, 100, seen({}))), ElementsAre(7));
  EXPECT_THAT(ids(r.update(151, 100, seen({}))), IsEmpty());
}

TEST(Retention, SeeingAPatchAgainRestartsItsTime) {
  Retention r;
  r.update(0, 100, seen({1}));
  r.update(90, 100, seen({1}));
  EXPECT_THAT(ids(r.update(190, 100, seen({}))), ElementsAre(1));
  EXPECT_THAT(ids(r.update(191, 100, seen({}))), IsEmpty());
}

TEST(Retention, UsesTheLastFootprintSeen) {
  Retention r;
  r.update(0, 100, seen({1}, 2 * kLarge));
  EXPECT_EQ(r.update(10, 100, seen({1}, kLarge))[0].footprint.u_px, kLarge);
  EXPECT_EQ(r.update(20, 100, seen({}))[0].footprint.u_px, kLarge);
}

TEST(Retention, ZeroTimeKeepsOnlyWhatIsSeenOrSmall) {
  Retention r;
  r.update(0, 0, seen({1, 2}));
  EXPECT_THAT(ids(r.update(1, 0, seen({2, 3}))), ElementsAre(2, 3));
  r.update(1, 0, seen({4, 5}, 1));
  EXPECT_THAT(ids(r.update(2, 0, seen({5, 6}))), ElementsAre(4, 5, 6));
}

TEST(Retention, ATimeThatChangesCountsAtOnce) {
  Retention r;
  r.update(0, 100, seen({1, 2}));
  EXPECT_THAT(ids(r.update(60, 100, seen({2}))), ElementsAre(1, 2));
  EXPECT_THAT(ids(r.update(61, 50, seen({2}))), ElementsAre(2));
}

TEST(Retention, AClockThatJumpsBackKeepsNothingForEver) {
  Retention r;
  r.update(1'000'000, 100, seen({5}));
  EXPECT_THAT(ids(r.update(0, 100, seen({}))), ElementsAre(5));
  EXPECT_THAT(ids(r.update(101, 100, seen({}))), IsEmpty());
  r.update(from_seconds(9), 100, seen({5, 6}, 1));
  EXPECT_THAT(ids(r.update(0, 100, seen({6}, 1))), ElementsAre(5, 6));
  EXPECT_THAT(ids(r.update(from_seconds(1) + 1, 100, seen({7}))), ElementsAre(7));
}

TEST(Retention, TheLastPatchIdIsKeptToo) {
  Retention r;
  r.update(0, 100, seen({0, 0xffffffffu}));
  EXPECT_THAT(ids(r.update(1, 100, seen({}))), ElementsAre(0u, 0xffffffffu));
}

// The longest that a patch of this area stays, in seconds.
double stay_s(float area_px2, DurationNs keep_ns) {
  Retention r;
  // Enough of others that none has to go.
  const scene::VisiblePatches other{{7, {1, 1, 1}}};
  r.update(0, keep_ns, {{1, {1, 1, 1e6f}}});
  r.update(0, keep_ns, {{1, {1, 1, area_px2}}});
  DurationNs low = 0, high = from_seconds(1e4);
  while (high - low > 1) {
    const DurationNs middle = (low + high) / 2;
    Retention copy = r;
    (copy.update(middle, keep_ns, other).size() == 1 ? high : low) = middle;
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

TEST(Retention, WhatIsNoAreaStaysAsLongAsOthers) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  for (const float area : {std::numeric_limits<float>::quiet_NaN(), kInfinity, -kInfinity, -1.0f})
    EXPECT_NEAR(stay_s(area, from_ms(100)), 0.1, 1e-6) << area;
}

TEST(Retention, AQuickTurnKeepsNoMoreThanTwiceWhatIsSeen) {
  constexpr DurationNs kFrame = from_ms(10), kKeep = 3 * kFrame;
  constexpr uint32_t kSeen = 100;
  Retention r;
  for (uint32_t frame = 0; frame < 80; ++frame) {
    scene::VisiblePatches now;
    for (uint32_t i = 0; i < kSeen; ++i) now.push_back({frame * kSeen + i, {1, 1, 1}});
    const auto kept = ids(r.update(frame * kFrame, kKeep, now));
    // Each frame sees others: those of this one and of the round trip, and the last two before that.
    const uint32_t frames = std::min(frame + 1, 1u + 3 + 2);
    ASSERT_EQ(kept.size(), frames * kSeen) << frame;
    EXPECT_EQ(kept.front(), (frame + 1 - frames) * kSeen);
  }
}

// Against the definition, patch by patch.
TEST(Retention, MatchesTheDefinitionOnRandomSets) {
  constexpr uint32_t kPatches = 50;
  constexpr DurationNs kFrame = from_ms(10), kKeep = 3 * kFrame;
  Retention r;
  std::vector<TimeNs> last(kPatches, from_seconds(-100));
  uint32_t random = 1;
  for (TimeNs t = 0; t < 500 * kFrame; t += kFrame) {
    scene::VisiblePatches now;
    for (uint32_t p = 0; p < kPatches; ++p) {
      random = random * 1664525u + 1013904223u;
      if (random >> 30 != 0) continue;
      // Some are small enough to stay for ten frames, too few for the limit.
      now.push_back({p, {1, 1, p % 8 == 1 ? 80.0f : 1e6f}});
      last[p] = t;
    }
    std::vector<scene::PatchId> want;
    for (uint32_t p = 0; p < kPatches; ++p) {
      if (t - last[p] <= (p % 8 == 1 ? 10 * kFrame : kKeep)) want.push_back(p);
    }
    ASSERT_EQ(ids(r.update(t, kKeep, now)), want) << "at " << t;
  }
}

}  // namespace
}  // namespace tessera::pvs
