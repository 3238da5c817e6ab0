#include "base/camera_path.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

namespace tessera {
namespace {

using testing::HasSubstr;

constexpr char kHeader[] = "t_seconds,px,py,pz,qx,qy,qz,qw\n";

StatusOr<CameraPath> parse(const std::string& lines) {
  std::istringstream in(kHeader + lines);
  return CameraPath::parse(in, "walk.csv");
}

TEST(CameraPath, ReadsPoses) {
  const auto path = parse("0.5,1,2,3,0,0,0,1\n1.5,3,2,1,0,1,0,0\n");
  ASSERT_TRUE(path.ok()) << path.status();
  ASSERT_EQ(path->poses().size(), 2u);
  EXPECT_EQ(path->poses()[0].time_ns, from_ms(500));
  EXPECT_EQ(path->poses()[0].pose.position, dvec3(1, 2, 3));
  EXPECT_EQ(path->poses()[1].pose.orientation, dquat(0, 0, 1, 0));
  EXPECT_EQ(path->duration_ns(), kNsPerSecond);
}

TEST(CameraPath, AcceptsWindowsLineEndsAndBlankLines) {
  const auto path = parse("0,1,2,3,0,0,0,1\r\n\r\n1,1,2,3,0,0,0,1\r\n\n");
  ASSERT_TRUE(path.ok()) << path.status();
  EXPECT_EQ(path->poses().size(), 2u);
}

TEST(CameraPath, BringsQuaternionsToUnitLength) {
  const auto path = parse("0,0,0,0,0,0,0,25\n1,0,0,0,1e-200,0,0,1e-200\n2,0,0,0,0,0,0,0\n");
  ASSERT_TRUE(path.ok()) << path.status();
  for (const TimedPose& p : path->poses()) EXPECT_NEAR(glm::length(p.pose.orientation), 1, 1e-12);
}

TEST(CameraPath, StandsStillOutsideAndInterpolatesInside) {
  const auto path = parse("1,0,0,0,0,0,0,1\n2,10,0,0,0,1,0,0\n4,10,4,0,0,1,0,0\n");
  ASSERT_TRUE(path.ok());
  EXPECT_EQ(path->at(from_seconds(-100)), path->poses().front().pose);
  EXPECT_EQ(path->at(from_seconds(100)), path->poses().back().pose);
  for (const TimedPose& p : path->poses()) {
    EXPECT_NEAR(glm::distance(path->at(p.time_ns).position, p.pose.position), 0, 1e-12);
  }
  const Pose middle = path->at(from_seconds(1.5));
  EXPECT_NEAR(middle.position.x, 5, 1e-9);
  EXPECT_NEAR(middle.orientation.y, std::sqrt(0.5), 1e-9);
  EXPECT_NEAR(path->at(from_seconds(3)).position.y, 2, 1e-9);
}

TEST(CameraPath, OnePoseStandsStill) {
  const auto path = parse("7,1,2,3,0,0,0,1\n");
  ASSERT_TRUE(path.ok());
  EXPECT_EQ(path->duration_ns(), 0);
  EXPECT_EQ(path->at(0), path->at(from_seconds(9)));
}

TEST(CameraPath, RejectsMalformedInputAndNamesTheLine) {
  const struct {
    const char *lines, *message;
  } cases[] = {
      {"", "no pose"},
      {"0,0,0,0,0,0,0\n", "line 2: 7 columns"},
      {"0,0,0,0,0,0,0,1,9\n", "line 2: 9 columns"},
      {"0,0,0,0,0,0,0,1\nx,0,0,0,0,0,0,1\n", "line 3: column 1"},
      {"0,nan,0,0,0,0,0,1\n", "column 2"},
      {"0,0,0,inf,0,0,0,1\n", "column 4"},
      {"0,0,0,0,0,0,0,\n", "column 8"},
      {"0,0,0,0,0,0,0,1e999\n", "column 8"},
      {"1,0,0,0,0,0,0,1\n1,0,0,0,0,0,0,1\n", "line 3: time does not increase"},
      {"1,0,0,0,0,0,0,1\n\n0.5,0,0,0,0,0,0,1\n", "line 4: time does not increase"},
      {"1e12,0,0,0,0,0,0,1\n", "out of range"},
      {"0,0,0,0,0,0,0,1\n1e-12,0,0,0,0,0,0,1\n", "time does not increase"},
  };
  for (const auto& c : cases) {
    const auto path = parse(c.lines);
    EXPECT_EQ(path.status().code(), absl::StatusCode::kInvalidArgument) << c.lines;
    EXPECT_THAT(path.status().message(), HasSubstr(c.message));
    EXPECT_THAT(path.status().message(), HasSubstr("walk.csv"));
  }
}

TEST(CameraPath, MissingFileIsNotFound) {
  const auto path = CameraPath::load("no/such/path.csv");
  EXPECT_EQ(path.status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(path.status().message(), HasSubstr("no/such/path.csv"));
}

}  // namespace
}  // namespace tessera
