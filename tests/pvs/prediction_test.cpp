#include "pvs/prediction.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <set>

namespace tessera::pvs {
namespace {

constexpr TimeNs kStart = 5 * kNsPerSecond;
constexpr DurationNs kFrame = kNsPerSecond / 60;

View client_view() {
  return {.fov = Fov::symmetric(1.0472f, 16.0f / 9), .width = 960, .height = 540};
}

PredictionSettings settings(double horizon_ms = 133.333) {
  return {.horizon_ns = from_ms(horizon_ms)};
}

// Moves with `velocity` and turns with `turn` (rad/s, camera axes), a pose a frame up to kStart.
Pose pose_at(const dvec3& velocity, const dvec3& turn, double seconds) {
  const double angle = glm::length(turn) * seconds;
  const dquat spin = glm::length(turn) > 0 ? glm::angleAxis(angle, glm::normalize(turn)) : dquat(1, 0, 0, 0);
  return {dvec3(1, 2, 3) + velocity * seconds, glm::angleAxis(0.7, glm::normalize(dvec3(1, 2, -1))) * spin};
}

std::vector<TimedPose> motion(const dvec3& velocity, const dvec3& turn, int poses = 12) {
  std::vector<TimedPose> out;
  for (int i = 1 - poses; i <= 0; ++i)
    out.push_back({kStart + i * kFrame, pose_at(velocity, turn, to_seconds(i * kFrame))});
  return out;
}

double angle_between(const dquat& a, const dquat& b) {
  const dquat d = glm::conjugate(a) * b;
  return 2 * std::atan2(glm::length(dvec3(d.x, d.y, d.z)), std::abs(d.w));
}

void expect_pose(const Pose& got, const Pose& want) {
  EXPECT_LT(glm::distance(got.position, want.position), 1e-6);
  EXPECT_LT(angle_between(got.orientation, want.orientation), 1e-6);
}

void expect_sane(const std::vector<View>& views) {
  ASSERT_FALSE(views.empty());
  for (const View& v : views) {
    EXPECT_NEAR(glm::length(v.pose.orientation), 1, 1e-9);
    for (int i = 0; i < 3; ++i) EXPECT_TRUE(std::isfinite(v.pose.position[i]));
    EXPECT_LT(v.fov.left, v.fov.right);
    EXPECT_LT(v.fov.down, v.fov.up);
    EXPECT_GT(v.width, 0u);
    EXPECT_LT(v.width, 16384u);
    EXPECT_GT(v.height, 0u);
    EXPECT_LT(v.height, 16384u);
  }
}

TEST(Prediction, CoversNowEveryStepAndTheHorizon) {
  const dvec3 velocity(2, 0, -1);
  const auto history = motion(velocity, dvec3(0));
  const auto views = predict_views(history, kStart, client_view(), settings(120));
  ASSERT_EQ(views.size(), 5u);
  const double ahead_ms[] = {0, 33.333333, 66.666666, 99.999999, 120};
  for (size_t i = 0; i < views.size(); ++i)
    expect_pose(views[i].pose, pose_at(velocity, dvec3(0), ahead_ms[i] * 1e-3));
}

TEST(Prediction, ConstantMotionIsContinuedExactly) {
  for (const dvec3& turn :
       {dvec3(0), dvec3(0, 1, 0), dvec3(0, -7, 0), dvec3(0.3, -0.5, 2), dvec3(1e-9, 0, 0)}) {
    for (const dvec3& velocity : {dvec3(0), dvec3(10, 0, 0), dvec3(-1, 2, 0.5)}) {
      for (const int poses : {2, 3, 4, 12}) {
        const auto views = predict_views(motion(velocity, turn, poses), kStart, client_view(), settings());
        expect_sane(views);
        expect_pose(views.front().pose, pose_at(velocity, turn, 0));
        expect_pose(views.back().pose, pose_at(velocity, turn, 0.133333));
      }
    }
  }
}

TEST(Prediction, AnOldPoseIsExtrapolatedFromItsOwnTime) {
  const dvec3 velocity(3, 0, 0);
  const auto views =
      predict_views(motion(velocity, dvec3(0)), kStart + from_ms(50), client_view(), settings(100));
  expect_pose(views.front().pose, pose_at(velocity, dvec3(0), 0));
  expect_pose(views[1].pose, pose_at(velocity, dvec3(0), 0.05));
  expect_pose(views.back().pose, pose_at(velocity, dvec3(0), 0.15));
}

TEST(Prediction, WithoutPredictionOnlyTheNewestPoseIsSeen) {
  PredictionSettings none = settings();
  none.mode = PredictionMode::none;
  const View client = client_view();
  const auto views = predict_views(motion({1, 2, 3}, {0, 1, 0}), kStart, client, none);
  ASSERT_EQ(views.size(), 1u);
  expect_pose(views[0].pose, pose_at({1, 2, 3}, {0, 1, 0}, 0));
  EXPECT_EQ(views[0].width, client.width);
  EXPECT_EQ(views[0].height, client.height);
  EXPECT_EQ(views[0].fov.left, client.fov.left);
}

TEST(Prediction, TheFieldGrowsByTheBaseMarginAndPixelsKeepTheirAngle) {
  const View client = client_view();
  const auto views = predict_views(motion(dvec3(0), dvec3(0)), kStart, client, settings());
  const float pixel = 1 / client.pixels_per_radian();
  for (const View& v : views) {
    EXPECT_NEAR(v.fov.width_rad(), 1.2f * client.fov.width_rad(), 2 * pixel);
    EXPECT_NEAR(v.fov.height_rad(), 1.2f * client.fov.height_rad(), 2 * pixel);
    EXPECT_NEAR(v.pixels_per_radian(), client.pixels_per_radian(), 1e-4f * client.pixels_per_radian());
  }
}

TEST(Prediction, TheFirstViewHasTheClientsPixelCentresAndTheOthersItsSamples) {
  const View client = client_view();
  const auto views = predict_views(motion(dvec3(0), dvec3(0)), kStart, client, settings());
  const double pixel = double(client.fov.right - client.fov.left) / client.width;
  const auto phase = [&](double tangents) { return tangents / pixel - std::round(tangents / pixel); };
  std::set<int> offsets;  // in eighths of a pixel
  for (const View& v : views)
    offsets.insert(static_cast<int>(std::round(8 * phase(v.fov.left - client.fov.left))));
  EXPECT_NEAR(phase(views[0].fov.left - client.fov.left), 0, 1e-2);
  EXPECT_NEAR(phase(views[0].fov.up - client.fov.up), 0, 1e-2);
  EXPECT_EQ(offsets, (std::set<int>{-3, -1, 0, 1, 3}));
}

TEST(Prediction, NoMarginLeavesTheViewAlone) {
  PredictionSettings bare = settings();
  bare.max_margin_rad = 0;
  for (const View& v : predict_views(motion({1, 0, 0}, {0, 2, 0}), kStart, client_view(), bare)) {
    EXPECT_EQ(v.width, client_view().width);
    EXPECT_EQ(v.height, client_view().height);
  }
}

TEST(Prediction, ATurnWidensItsAxisMoreFurtherAhead) {
  const auto views = predict_views(motion(dvec3(0), {0, 2, 0}), kStart, client_view(), settings());
  for (size_t i = 1; i < views.size(); ++i) {
    EXPECT_GT(views[i].fov.width_rad(), views[i - 1].fov.width_rad());
    EXPECT_NEAR(views[i].fov.height_rad(), views[i - 1].fov.height_rad(), 1e-3);
  }
  const auto nod = predict_views(motion(dvec3(0), {2, 0, 0}), kStart, client_view(), settings());
  EXPECT_GT(nod.back().fov.height_rad(), nod.front().fov.height_rad());
}

TEST(Prediction, AnAcceleratingTurnWidensMoreThanASteadyOne) {
  std::vector<TimedPose> jerk = motion(dvec3(0), dvec3(0));
  jerk.back().pose.orientation = jerk.back().pose.orientation * glm::angleAxis(0.1, dvec3(0, 1, 0));
  const auto steady = predict_views(motion(dvec3(0), {0, 2, 0}), kStart, client_view(), settings());
  const auto sudden = predict_views(jerk, kStart, client_view(), settings());
  EXPECT_GT(sudden.back().fov.width_rad(), steady.back().fov.width_rad());
}

TEST(Prediction, MarginsStayBelowTheirLimits) {
  for (const double rate : {0.1, 1.0, 7.0, 19.0}) {
    for (const float fov : {0.01745f, 1.0f, 2.5f, 3.124f}) {
      View client = client_view();
      client.fov = Fov::symmetric(fov, 1);
      const auto views = predict_views(motion(dvec3(0), {rate, rate, rate}), kStart, client, settings(500));
      for (const View& v : views) {
        EXPECT_LE(v.fov.width_rad(), client.fov.width_rad() + 2 * 0.7f + 0.01f);
        EXPECT_GE(v.fov.width_rad(), client.fov.width_rad() - 0.01f);
      }
    }
  }
}

TEST(Prediction, BrokenHistoriesStandStill) {
  const auto expect_still = [](const std::vector<TimedPose>& history, TimeNs now) {
    const auto views = predict_views(history, now, client_view(), settings());
    expect_sane(views);
    for (const View& v : views) expect_pose(v.pose, normalized(history.back().pose));
  };
  auto history = motion({5, 0, 0}, {0, 1, 0});
  expect_still({history.back()}, kStart);
  expect_still(history, kStart + kNsPerSecond);       // nothing new for a second
  expect_still(history, kStart - 10 * kNsPerSecond);  // the clock jumped back
  auto repeated = history;
  repeated.back().time_ns = repeated[repeated.size() - 2].time_ns;
  expect_still(repeated, kStart);
  auto backward = history;
  backward.back().time_ns -= 5 * kNsPerSecond;
  expect_still(backward, backward.back().time_ns);
  auto gap = history;
  gap.back().time_ns += from_ms(501);
  expect_still(gap, gap.back().time_ns);
  auto teleport = history;
  teleport.back().pose.position.x += 1000;
  expect_still(teleport, kStart);
}

TEST(Prediction, AGapFurtherBackDoesNotStopTheMotionAfterIt) {
  const dvec3 velocity(5, 0, 0);
  auto history = motion(velocity, dvec3(0));
  for (size_t i = 0; i + 3 < history.size(); ++i) history[i].time_ns -= 2 * kNsPerSecond;
  const auto views = predict_views(history, kStart, client_view(), settings());
  expect_pose(views.back().pose, pose_at(velocity, dvec3(0), 0.133333));
}

TEST(Prediction, NoiseIsSmoothed) {
  const dvec3 velocity(2, 0, 0);
  auto history = motion(velocity, dvec3(0));
  history[history.size() - 2].pose.position.x += 0.02;  // one pose 2 cm off: 1.2 m/s for a single pair
  const auto views = predict_views(history, kStart, client_view(), settings());
  EXPECT_LT(glm::distance(views.back().pose.position, pose_at(velocity, dvec3(0), 0.133333).position), 0.05);
}

TEST(Prediction, UnnormalisedAndHostileInputStaysSane) {
  const double inf = std::numeric_limits<double>::infinity(), nan = std::nan("");
  for (const double bad : {0.0, 1e-300, 1e300, inf, nan}) {
    auto history = motion({1, 0, 0}, {0, 1, 0});
    history.back().pose.orientation = dquat(bad, bad, 0, 0);
    history[history.size() - 2].pose.position = dvec3(bad, 0, -bad);
    expect_sane(predict_views(history, kStart, client_view(), settings()));
  }
  auto scaled = motion({1, 0, 0}, {0, 1, 0});
  for (TimedPose& p : scaled) p.pose.orientation = p.pose.orientation * 37.0;
  expect_pose(predict_views(scaled, kStart, client_view(), settings()).back().pose,
              pose_at({1, 0, 0}, {0, 1, 0}, 0.133333));
}

TEST(Prediction, ExtremeSettingsGiveFewViews) {
  PredictionSettings s = settings(10'000);
  s.step_ns = 1;
  EXPECT_LE(predict_views(motion({1, 0, 0}, dvec3(0)), kStart, client_view(), s).size(), 70u);
  s.horizon_ns = -5;
  s.step_ns = -1;
  EXPECT_EQ(predict_views(motion({1, 0, 0}, dvec3(0)), kStart, client_view(), s).size(), 1u);
}

TEST(Prediction, AsymmetricFrustaStayAsymmetric) {
  View client = client_view();
  client.fov = {-0.5f, 1.2f, -0.9f, 0.7f};
  const auto views = predict_views(motion(dvec3(0), dvec3(0)), kStart, client, settings());
  EXPECT_LT(views[0].fov.left, -0.5f);
  EXPECT_GT(views[0].fov.right, 1.2f);
  EXPECT_NEAR(std::atan(views[0].fov.right) - std::atan(1.2f),
              std::atan(-0.5f) - std::atan(views[0].fov.left), 2e-3);
}

// A head that turns carries its eyes along on a circle.
TEST(Prediction, EyesMoveWithTheirHead) {
  const std::vector<Eye> eyes{
      {.in_head = {{-0.1, 0, 0}, glm::angleAxis(0.2, dvec3(0, 1, 0))}, .fov = {-1, 0.8f, -1, 1}},
      {.in_head = {{0.1, 0.02, 0}, {}}, .fov = {-0.8f, 1, -1, 1}}};
  const auto history = motion({1, 0, 0}, {0, 2, 0});
  const auto heads = predict_views(history, kStart, client_view(), settings(100));
  const auto views = predict_views(history, kStart, client_view(), eyes, settings(100));
  ASSERT_EQ(views.size(), 2 * heads.size());
  for (size_t e = 0; e < eyes.size(); ++e) {
    for (size_t i = 0; i < heads.size(); ++i) {
      const View& view = views[e * heads.size() + i];
      const Pose &head = heads[i].pose, &eye = eyes[e].in_head;
      expect_pose(view.pose,
                  {head.position + head.orientation * eye.position, head.orientation * eye.orientation});
      EXPECT_LE(view.fov.left, eyes[e].fov.left);
      EXPECT_GE(view.fov.right, eyes[e].fov.right);
    }
  }
}

}  // namespace
}  // namespace tessera::pvs
