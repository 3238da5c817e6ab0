#include "server/viewers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tessera::server {
namespace {

using testing::SizeIs;

constexpr double kHalfTurn = 3.14159265358979323846;

View client() {
  View view;
  view.width = 640;
  view.height = 360;
  view.fov = Fov::symmetric(1.0f, 16.0f / 9.0f);
  return view;
}

View at(const dvec3& position, double yaw = 0) {
  View view = client();
  view.pose = {position, glm::angleAxis(yaw, dvec3(0, 1, 0))};
  return view;
}

void expect_near(const dvec3& a, const dvec3& b) {
  EXPECT_NEAR(glm::distance(a, b), 0, 1e-12) << a.x << " " << a.y << " " << a.z;
}

TEST(Viewers, WithoutEyesTheClientViewIsOne) {
  SessionSettings settings{.client_view = client()};
  ASSERT_THAT(eyes_of(settings), SizeIs(1));
  EXPECT_EQ(eyes_of(settings)[0].in_head, Pose{});
  EXPECT_EQ(eyes_of(settings)[0].fov.right, client().fov.right);
  settings.eyes.resize(2);
  EXPECT_THAT(eyes_of(settings), SizeIs(2));
}

TEST(Viewers, TheEyeWithTheFinestPixelsDecides) {
  const std::vector<Eye> eyes{{.fov = Fov::symmetric(1.2f, 1.5f)}, {.fov = Fov::symmetric(0.7f, 1.5f)}};
  const View finest = finest_view(client(), eyes);
  EXPECT_EQ(finest.fov.up, eyes[1].fov.up);
  EXPECT_EQ(finest.width, client().width);
  const atlas::DensityDisplay display = display_of(finest, eyes);
  EXPECT_EQ(display.pixels_per_radian, finest.pixels_per_radian());
  EXPECT_FLOAT_EQ(display.half_field_rad, std::atan(eyes[0].fov.right)) << "of the wider field";
}

TEST(Viewers, AHeadAtRestLooksOneWay) {
  const std::vector<View> views(5, at({1, 2, 3}));
  const atlas::Viewers viewers = viewers_of(views, views, {});
  ASSERT_THAT(viewers.gazes, SizeIs(1));
  ASSERT_THAT(viewers.axes, SizeIs(1));
  expect_near(viewers.gazes[0].eye, {1, 2, 3});
  expect_near(viewers.gazes[0].direction, {0, 0, -1});
}

TEST(Viewers, GazesTurnWithTheHeadAndAxesWithTheEye) {
  // A head turned to the left, an eye that is turned to the right within it, and a gaze to the right.
  const std::vector<View> heads{at({0, 0, 0}, kHalfTurn / 2)}, eyes{at({0, 0, 1}, kHalfTurn / 2 - 0.3)};
  const atlas::Viewers viewers = viewers_of(eyes, heads, vec3(1, 0, 0));
  ASSERT_THAT(viewers.gazes, SizeIs(2));
  for (const atlas::GazeRay& gaze : viewers.gazes) expect_near(gaze.direction, {0, 0, -1});
  expect_near(viewers.gazes[0].eye, {0, 0, 0});
  expect_near(viewers.gazes[1].eye, {0, 0, 1});
  ASSERT_THAT(viewers.axes, SizeIs(1));
  expect_near(viewers.axes[0].direction, {-std::cos(0.3), 0, -std::sin(0.3)});
}

TEST(Viewers, EveryPredictedViewCounts) {
  const std::vector<View> heads{at({0, 0, 0}), at({0, 0, 1})};
  const std::vector<View> eyes{at({-1, 0, 0}), at({-1, 0, 1}), at({1, 0, 0}), at({1, 0, 1})};
  const atlas::Viewers viewers = viewers_of(eyes, heads, {});
  EXPECT_THAT(viewers.gazes, SizeIs(6)) << "two eyes and what lies between them, at two times";
  EXPECT_THAT(viewers.axes, SizeIs(4));
}

}  // namespace
}  // namespace tessera::server
