#include "client-sdk/meta_checker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>

#include "meta_builder.h"

namespace tessera::client {
namespace {

using namespace test;
using ::testing::HasSubstr;

TEST(MetaChecker, AcceptsFramesThatBuildOnEachOther) {
  MetaChecker checker;
  ASSERT_TRUE(checker.check(first_frame(0xffffffffu)).ok());
  MetaFrame second = next_frame(0);  // wrapped around
  second.vertices.push_back({0, {1, 1, 1}});
  second.patches.push_back({.object = 0, .triangles = 1, .vertices = {0, 1, 5}});
  second.placements.push_back(in_block(1, 8, 8, 8, 8));
  second.moved.push_back({});
  EXPECT_TRUE(checker.check(second).ok());
}

TEST(MetaChecker, StartsOnlyWithAFullState) {
  MetaChecker checker;
  MetaFrame frame = first_frame(1);
  frame.full_state = false;
  EXPECT_EQ(checker.check(frame).code(), absl::StatusCode::kDataLoss);
  frame.full_state = true;
  EXPECT_TRUE(checker.check(frame).ok());
}

TEST(MetaChecker, RefusesOldAndRepeatedFrameNumbers) {
  for (uint32_t late : {5u, 4u, 5u - 0x7fffffffu}) {
    MetaChecker checker;
    ASSERT_TRUE(checker.check(first_frame(5)).ok());
    EXPECT_THAT(std::string(checker.check(next_frame(late)).message()), HasSubstr("not newer than 5"));
  }
}

struct HostileCase {
  std::string named;  // what the message must name
  std::function<void(MetaFrame&)> damage;
};

void PrintTo(const HostileCase& c, std::ostream* out) {
  *out << c.named;
}

class Hostile : public ::testing::TestWithParam<HostileCase> {};

// The damaged frame follows a good one, and is followed by one that builds on it and one that starts anew.
TEST_P(Hostile, IsRefusedByNameAndEndsTheStateUntilFullState) {
  for (bool full_state : {false, true}) {
    MetaChecker checker;
    ASSERT_TRUE(checker.check(first_frame(1)).ok());
    MetaFrame frame = full_state ? first_frame(2) : next_frame(2);
    GetParam().damage(frame);
    const Status status = checker.check(frame);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(status.message()), HasSubstr(GetParam().named));
    EXPECT_EQ(checker.check(next_frame(3)).code(), absl::StatusCode::kDataLoss);
    EXPECT_TRUE(checker.check(first_frame(4)).ok());
    EXPECT_TRUE(checker.check(next_frame(5)).ok());
  }
}

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

const HostileCase kHostile[] = {
    {"atlas_width is 0", [](MetaFrame& f) { f.atlas_width = 0; }},
    {"atlas_height is 17", [](MetaFrame& f) { f.atlas_height = 17; }},
    {"atlas_width is 8194", [](MetaFrame& f) { f.atlas_width = 8194; }},
    {"meshes.step of entry", [](MetaFrame& f) { f.meshes.push_back({.step = 0}); }},
    {"meshes.step of entry", [](MetaFrame& f) { f.meshes.push_back({.step = kNan}); }},
    {"meshes.offset of entry",
     [](MetaFrame& f) {
       f.meshes.push_back({.offset = {0, kInf, 0}});
     }},
    {"vertices.mesh of entry", [](MetaFrame& f) { f.vertices.push_back({.mesh = 1}); }},
    {"1073741824",
     [](MetaFrame& f) {
       f.vertices.push_back({.q = {0, 1 << 30, 0}});
     }},
    {"-2147483648",
     [](MetaFrame& f) {
       f.vertices.push_back({.q = {0, 0, std::numeric_limits<int32_t>::min()}});
     }},
    {"outside the range of float",
     [](MetaFrame& f) {
       f.meshes.push_back({.step = 1e38});
       f.vertices.push_back({.mesh = 1, .q = {9, 0, 0}});
     }},
    {"objects.translation",
     [](MetaFrame& f) {
       f.objects.push_back({.transform = {.translation = {0, kNan, 0}}});
     }},
    {"objects.linear", [](MetaFrame& f) { f.objects.push_back({.transform = {.linear = {float(kInf)}}}); }},
    {"moved.object of entry 0 is 1", [](MetaFrame& f) { f.moved.push_back({.object = 1}); }},
    {"moved.translation",
     [](MetaFrame& f) {
       f.moved.push_back({.transform = {.translation = {kInf, 0, 0}}});
     }},
    {"patches.object", [](MetaFrame& f) { f.patches.push_back({.object = 1}); }},
    {"patches.vertices",
     [](MetaFrame& f) {
       f.patches.push_back({.vertices = {0, 1, 5}});
     }},
    {"patches.triangles", [](MetaFrame& f) { f.patches.push_back({.triangles = 0}); }},
    {"patches.triangles", [](MetaFrame& f) { f.patches.push_back({.triangles = 4}); }},
    {"placements.patch of entry 0 is 1", [](MetaFrame& f) { f.placements.push_back(in_color(1, 0)); }},
    {"placements.rgb", [](MetaFrame& f) { f.placements.push_back(in_color(0, 0x1000000)); }},
    {"placements.kind",
     [](MetaFrame& f) { f.placements.push_back({.kind = static_cast<PlacementKind>(5)}); }},
    {"placements.width", [](MetaFrame& f) { f.placements.push_back(in_block(0, 0, 0, 0, 2)); }},
    {"placements.width", [](MetaFrame& f) { f.placements.push_back(in_block(0, 0, 0, 3, 2)); }},
    {"placements.width", [](MetaFrame& f) { f.placements.push_back(in_block(0, 0, 0, 2, 258)); }},
    {"placements.spacing",
     [](MetaFrame& f) {
       f.placements.push_back(in_block(0, 0, 0, 2, 2));
       f.placements.back().spacing[3] = 127;
     }},
    {"placements.x, y", [](MetaFrame& f) { f.placements.push_back(in_block(0, 1, 0, 2, 2)); }},
    {"placements.x, y", [](MetaFrame& f) { f.placements.push_back(in_block(0, 16, 0, 2, 2)); }},
    {"placements.x, y", [](MetaFrame& f) { f.placements.push_back(in_block(0, 0, 14, 4, 4)); }},
    {"placements.x, y", [](MetaFrame& f) { f.placements.push_back(in_block(0, 0, 65534, 2, 2)); }},
    {"placements.part",
     [](MetaFrame& f) {
       f.placements.push_back(in_block(0, 0, 0, 2, 2));
       f.placements.back().part = 1;
     }},
    {"placements.part", [](MetaFrame& f) { f.placements.push_back(in_l(0, 3, 0, 0, 2)); }},
    {"placements.part", [](MetaFrame& f) { f.placements.push_back(in_l(0, 0, 0, 0, 2)); }},
    {"placements.l of entry 0 has level 0",
     [](MetaFrame& f) { f.placements.push_back(in_l(0, 1, 0, 0, 0)); }},
    {"placements.l of entry 0 has level 65",
     [](MetaFrame& f) { f.placements.push_back(in_l(0, 1, 0, 0, 65)); }},
    {"splits 0", [](MetaFrame& f) { f.placements.push_back(in_l(0, 1, 0, 0, 2, 0)); }},
    {"splits 32", [](MetaFrame& f) { f.placements.push_back(in_l(0, 1, 0, 0, 1, 32)); }},
    {"placements.l of entry 0 lies at", [](MetaFrame& f) { f.placements.push_back(in_l(0, 1, 1, 0, 2)); }},
    {"placements.l of entry 0 lies at",
     [](MetaFrame& f) {
       f.objects.push_back({.masked = true});
       f.patches.push_back({.object = 1, .vertices = {0, 1, 2}});
       f.placements.push_back(in_l(1, 1, 0, 0, 2));
       f.placements.back().l.turned = true;
     }},
    {"must lie inside", [](MetaFrame& f) { f.placements.push_back(in_l(0, 1, 12, 0, 2)); }},
    {"must lie inside", [](MetaFrame& f) { f.placements.push_back(in_l(0, 1, 0, 14, 2)); }},
    {"must lie inside", [](MetaFrame& f) { f.placements.push_back(in_l(0, 1, 0, 0, 30)); }},
    {"must lie inside",  // the last pair would be in the third row
     [](MetaFrame& f) {
       f.placements.push_back(in_l(0, 1, 8, 0, 2, 3));
       f.placements.back().l.next_y = 10;
     }},
    {"placements.halves of entry 0 has apex 3",
     [](MetaFrame& f) { f.placements.push_back(in_halves(0, 1, 3, 5, 5, 0, 0)); }},
    {"across 0", [](MetaFrame& f) { f.placements.push_back(in_halves(0, 1, 0, 0, 5, 0, 0)); }},
    {"across 129", [](MetaFrame& f) { f.placements.push_back(in_halves(0, 1, 0, 129, 5, 0, 0)); }},
    {"placements.halves.along", [](MetaFrame& f) { f.placements.push_back(in_halves(0, 1, 0, 2, 0, 0, 0)); }},
    {"placements.halves.along",
     [](MetaFrame& f) { f.placements.push_back(in_halves(0, 1, 0, 2, 1025, 0, 0)); }},
    {"placements.halves of entry 0 at",
     [](MetaFrame& f) { f.placements.push_back(in_halves(0, 1, 0, 2, 5, 11, 0)); }},
    {"placements.halves of entry 0 at",
     [](MetaFrame& f) { f.placements.push_back(in_halves(0, 1, 0, 2, 5, 0, 14)); }},
    {"placements.halves of entry 0 at",
     [](MetaFrame& f) { f.placements.push_back(in_halves(0, 1, 0, 2, 5, 0, 1)); }},
};
INSTANTIATE_TEST_SUITE_P(MetaChecker, Hostile, ::testing::ValuesIn(kHostile));

TEST(MetaChecker, AcceptsTrianglesUpToTheEdgeOfTheAtlas) {
  MetaChecker checker;
  MetaFrame frame = first_frame(1);
  frame.placements = {in_l(0, 1, 10, 12, 2), in_halves(0, 2, 2, 2, 5, 10, 12)};
  EXPECT_EQ(checker.check(frame), absl::OkStatus());
  frame = next_frame(2);
  frame.placements = {in_l(0, 1, 8, 0, 2, 2),
                      in_color(0, 5)};  // four Ls: two pairs, the second in the next row
  frame.placements[0].l.next_y = 12;
  frame.placements[1].part = 2;
  EXPECT_EQ(checker.check(frame), absl::OkStatus());
}

TEST(MetaChecker, AtlasSizeChangesOnlyWithAFullState) {
  MetaChecker checker;
  ASSERT_TRUE(checker.check(first_frame(1)).ok());
  MetaFrame larger = next_frame(2);
  larger.atlas_width = 32;
  EXPECT_THAT(std::string(checker.check(larger).message()), HasSubstr("32x16 after 16x16"));
  larger = first_frame(3);
  larger.atlas_width = 32;
  EXPECT_TRUE(checker.check(larger).ok());
}

TEST(MetaChecker, CountsAreCumulativeAndForgottenWithAFullState) {
  MetaChecker checker;
  ASSERT_TRUE(checker.check(first_frame(1)).ok());
  MetaFrame big = next_frame(2);
  big.objects.resize((1u << 20) - 1);
  ASSERT_TRUE(checker.check(big).ok());
  MetaFrame one_more = next_frame(3);
  one_more.objects.resize(1);
  EXPECT_THAT(std::string(checker.check(one_more).message()), HasSubstr("objects would be 1048577"));
  ASSERT_TRUE(checker.check(first_frame(4)).ok());
  MetaFrame stale = next_frame(5);
  stale.moved.push_back({.object = 1000});
  EXPECT_THAT(std::string(checker.check(stale).message()),
              HasSubstr("moved.object of entry 0 is 1000, but only 1"));
}

}  // namespace
}  // namespace tessera::client
