#include "base/view.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace tessera {
namespace {

constexpr double kPi = 3.14159265358979323846;

float radians(double degrees) {
  return static_cast<float>(degrees * kPi / 180);
}

dquat random_rotation(std::mt19937& random) {
  std::normal_distribution<double> normal;
  return glm::normalize(dquat(normal(random), normal(random), normal(random), normal(random)));
}

double angle_between(const dquat& a, const dquat& b) {
  return 2 * std::acos(std::min(1.0, std::abs(glm::dot(a, b))));
}

vec3 project(const mat4& matrix, vec3 point) {
  const vec4 clip = matrix * vec4(point, 1);
  return vec3(clip) / clip.w;
}

TEST(Pose, NormalizedIsAlwaysAUnitQuaternionAtAFinitePosition) {
  const double inf = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();
  const double values[] = {0, 1, -1, 1e-320, 1e-200, 1e200, -1.7e308, inf, -inf, nan};
  for (const double x : values) {
    for (const double y : values) {
      for (const double w : values) {
        const Pose pose = normalized({dvec3(x, y, w), dquat(w, x, y, x)});
        EXPECT_NEAR(glm::length(pose.orientation), 1, 1e-12) << x << " " << y << " " << w;
        for (int i = 0; i < 3; ++i) EXPECT_TRUE(std::isfinite(pose.position[i]));
      }
    }
  }
}

TEST(Pose, NormalizedKeepsTheRotationAndFinitePositions) {
  std::mt19937 random(1);
  for (const double scale : {1e-300, 1e-10, 0.5, 3.0, 1e10, 1e300}) {
    const dquat q = random_rotation(random);
    const Pose pose = normalized({dvec3(1e7, -2, 3), q * scale});
    EXPECT_LT(angle_between(pose.orientation, q), 1e-7) << scale;
    EXPECT_EQ(pose.position, dvec3(1e7, -2, 3));
  }
  EXPECT_EQ(normalized({dvec3(0), dquat(0, 0, 0, 0)}).orientation, dquat(1, 0, 0, 0));
}

TEST(Pose, InterpolationMeetsItsEndsAndTakesTheShorterArc) {
  std::mt19937 random(2);
  for (int i = 0; i < 500; ++i) {
    const Pose a{dvec3(1, 2, 3), random_rotation(random)};
    Pose b{dvec3(-3, 5, 7), random_rotation(random)};
    if (i % 2) b.orientation = -b.orientation;  // the same rotation
    const double arc = angle_between(a.orientation, b.orientation);
    EXPECT_LT(angle_between(interpolate(a, b, 0).orientation, a.orientation), 1e-6);
    EXPECT_LT(angle_between(interpolate(a, b, 1).orientation, b.orientation), 1e-6);
    const Pose half = interpolate(a, b, 0.5);
    EXPECT_NEAR(angle_between(half.orientation, a.orientation), arc / 2, 1e-6);
    EXPECT_NEAR(angle_between(half.orientation, b.orientation), arc / 2, 1e-6);
    EXPECT_NEAR(glm::length(half.orientation), 1, 1e-12);
    EXPECT_NEAR(glm::distance(half.position, dvec3(-1, 3.5, 5)), 0, 1e-12);
  }
}

TEST(Pose, InterpolationExtrapolatesAtConstantSpeed) {
  const auto yaw = [](double angle) { return dquat(std::cos(angle / 2), 0, std::sin(angle / 2), 0); };
  const Pose a{dvec3(0), yaw(0.1)}, b{dvec3(1, 0, 0), yaw(0.2)};
  for (const double t : {-2.0, -0.5, 1.5, 3.0}) {
    EXPECT_LT(angle_between(interpolate(a, b, t).orientation, yaw(0.1 + 0.1 * t)), 1e-6);
    EXPECT_NEAR(interpolate(a, b, t).position.x, t, 1e-12);
  }
}

TEST(Fov, SymmetricSpansItsAngles) {
  for (const double degrees : {1.0, 30.0, 60.0, 90.0, 150.0, 179.0}) {
    const Fov fov = Fov::symmetric(radians(degrees), 1);
    EXPECT_NEAR(fov.height_rad(), radians(degrees), 1e-5) << degrees;
    EXPECT_NEAR(fov.width_rad(), radians(degrees), 1e-5) << degrees;
    EXPECT_FLOAT_EQ(fov.left, -fov.right);
  }
  EXPECT_FLOAT_EQ(Fov::symmetric(radians(60), 16.0f / 9).right / Fov::symmetric(radians(60), 16.0f / 9).up,
                  16.0f / 9);
}

TEST(Fov, WidensEachSideUpToTheLimit) {
  const Fov fov{-0.5f, 1.2f, -0.1f, 0.9f};
  const Fov wide = fov.widened(0.1f, 0.2f);
  EXPECT_NEAR(wide.width_rad(), fov.width_rad() + 0.2f, 1e-5);
  EXPECT_NEAR(wide.height_rad(), fov.height_rad() + 0.4f, 1e-5);
  EXPECT_NEAR(std::atan(wide.left), std::atan(fov.left) - 0.1f, 1e-5);
  for (const float by : {0.7f, 3.0f, 100.0f}) {
    for (const double degrees : {1.0, 60.0, 179.0}) {
      const Fov most = Fov::symmetric(radians(degrees), 1).widened(by, by);
      for (const float tangent : {-most.left, most.right, -most.down, most.up}) {
        EXPECT_TRUE(std::isfinite(tangent));
        EXPECT_GT(tangent, 0);
        EXPECT_LE(std::atan(tangent), radians(89.5) + 1e-5);
      }
    }
  }
  const Fov same = fov.widened(0, 0);
  EXPECT_NEAR(same.left, fov.left, 1e-6);
  EXPECT_NEAR(same.up, fov.up, 1e-6);
}

TEST(View, PixelsPerRadianAtTheCentre) {
  View view{.fov = Fov::symmetric(radians(90), 2), .width = 2000, .height = 1000};
  EXPECT_NEAR(view.pixels_per_radian(), 500, 1e-2);
  for (const double degrees : {1.0, 179.0}) {
    view.fov = Fov::symmetric(radians(degrees), 2);
    EXPECT_NEAR(view.pixels_per_radian() * 2 * std::tan(degrees * kPi / 360), 1000, 0.1) << degrees;
  }
}

// The catalogue's cameras: 1 and 179 degrees, and frusta that do not contain their axis.
TEST(Projection, CornersOfTheFrustumMeetCornersOfTheScreen) {
  const Fov fovs[] = {Fov::symmetric(radians(1), 1.5f), Fov::symmetric(radians(179), 1),
                      Fov::symmetric(radians(60), 2),   Fov{-0.2f, 1.5f, -0.9f, 0.1f},
                      Fov{0.5f, 0.7f, -0.3f, -0.2f},    Fov{-100, 0.01f, -0.01f, 100}};
  for (const Fov& fov : fovs) {
    const mat4 matrix = projection_matrix(fov, kDefaultNearM);
    for (const float depth : {kDefaultNearM, 1.0f, 1000.0f, 1e6f}) {
      for (const bool right : {false, true}) {
        for (const bool up : {false, true}) {
          const vec3 corner((right ? fov.right : fov.left) * depth, (up ? fov.up : fov.down) * depth, -depth);
          const vec3 ndc = project(matrix, corner);
          EXPECT_NEAR(ndc.x, right ? 1 : -1, 2e-4);
          EXPECT_NEAR(ndc.y, up ? 1 : -1, 2e-4);
          EXPECT_NEAR(ndc.z, kDefaultNearM / depth, 1e-6f);
        }
      }
    }
  }
}

TEST(Projection, DepthFallsFromOneAtTheNearPlaneToZero) {
  const mat4 matrix = projection_matrix(Fov{}, 0.05f);
  EXPECT_FLOAT_EQ(project(matrix, vec3(0, 0, -0.05f)).z, 1);
  float last = 2;
  for (float depth = 0.05f; depth < 1e7f; depth *= 1.5f) {
    const float z = project(matrix, vec3(0, 0, -depth)).z;
    EXPECT_LT(z, last);
    EXPECT_GT(z, 0);
    last = z;
  }
  EXPECT_EQ((matrix * vec4(0, 0, -1, 0)).z, 0) << "a point at infinity";
}

TEST(ViewMatrix, TakesTheCameraAxesHome) {
  std::mt19937 random(3);
  for (int i = 0; i < 200; ++i) {
    const Pose pose{dvec3(5, -3, 2), random_rotation(random)};
    const mat4 matrix = view_matrix(pose, dvec3(1, 1, 1));
    const dvec3 relative = pose.position - dvec3(1, 1, 1);
    const auto at = [&](dvec3 camera_space) {
      return vec3(matrix * vec4(vec3(relative + pose.orientation * camera_space), 1));
    };
    EXPECT_NEAR(glm::length(at({0, 0, 0})), 0, 1e-5);
    EXPECT_NEAR(glm::distance(at({0, 0, -2}), vec3(0, 0, -2)), 0, 1e-5);
    EXPECT_NEAR(glm::distance(at({3, 4, -5}), vec3(3, 4, -5)), 0, 1e-5);
  }
}

// Ten thousand kilometres from the scene's origin a millimetre still counts.
TEST(ViewMatrix, IsExactFarFromTheOrigin) {
  const dvec3 far(1e7, -1e7, 1e7);
  const Pose pose{far + dvec3(0.001, 0, 0), dquat(1, 0, 0, 0)};
  const vec4 at = view_matrix(pose, far) * vec4(0, 0, -1, 1);
  EXPECT_NEAR(at.x, -0.001f, 1e-7f);
  EXPECT_NEAR(at.z, -1, 1e-7f);
}

TEST(ViewProjection, IsIndependentOfTheOrigin) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int i = 0; i < 200; ++i) {
    const View view{
        .pose = {dvec3(uniform(random), uniform(random), uniform(random)), random_rotation(random)},
        .fov = {-0.7f, 0.4f, -0.5f, 0.6f},
        .width = 100,
        .height = 100};
    const dvec3 direction(0.3 * uniform(random), 0.3 * uniform(random), -1);
    const dvec3 point = view.pose.position + view.pose.orientation * (4.0 * direction);
    const dvec3 origin(10 * uniform(random), uniform(random), uniform(random));
    const vec3 a = project(view_projection(view, dvec3(0)), vec3(point));
    const vec3 b = project(view_projection(view, origin), vec3(point - origin));
    EXPECT_NEAR(glm::distance(a, b), 0, 1e-4);
  }
}

}  // namespace
}  // namespace tessera
