#include "atlas/density.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace tessera::atlas {
namespace {

using scene::VisiblePatches;
using testing::HasSubstr;

constexpr double kPi = 3.14159265358979323846;
constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr DensityDisplay kDisplay{.pixels_per_radian = 900, .half_field_rad = 0.8f};

double radians(double degrees) {
  return degrees * kPi / 180;
}

// The display of thesis 4.3: 1920 pixels over 90 degrees, 0.09375 degrees a cycle.
constexpr double kThesisPixelsPerRadian = 1920 / (3.14159265358979323846 / 2);

// The angle between a ray and a point, by the law of cosines: another way than the code's.
double angle_to(const GazeRay& ray, const dvec3& point) {
  const dvec3 to = point - ray.eye;
  const double a = glm::length(to), b = glm::length(ray.direction), c = glm::length(to - ray.direction);
  return std::acos(std::clamp((a * a + b * b - c * c) / (2 * a * b), -1.0, 1.0));
}

TEST(FovealScale, OfTheThesis) {
  // omega = 0.022 * 20 + 1/48 = 0.4608333 degrees, s = 4.9155556.
  EXPECT_NEAR(foveal_scale(radians(20), kThesisPixelsPerRadian), 1 / 4.9155556, 1e-7);
  // omega = 0.022 * 45 + 1/48 = 1.0108333 degrees, s = 10.7822222.
  EXPECT_NEAR(foveal_scale(radians(45), kThesisPixelsPerRadian), 1 / 10.7822222, 1e-7);
  // Half the pixels: half the loss.
  EXPECT_NEAR(foveal_scale(radians(20), kThesisPixelsPerRadian / 2), 2 / 4.9155556, 1e-7);
}

TEST(FovealScale, NeverExceedsTheDisplay) {
  // The display ends at (0.09375 - 1/48) / 0.022 = 3.3143939 degrees from the gaze.
  EXPECT_EQ(foveal_scale(0, kThesisPixelsPerRadian), 1);
  EXPECT_EQ(foveal_scale(radians(3.314), kThesisPixelsPerRadian), 1);
  EXPECT_LT(foveal_scale(radians(3.315), kThesisPixelsPerRadian), 1);
}

TEST(FovealScale, FallsAwayFromTheGaze) {
  double before = 1;
  for (double degrees = 0; degrees <= 180; degrees += 0.25) {
    const double scale = foveal_scale(radians(degrees), kThesisPixelsPerRadian);
    EXPECT_LE(scale, before);
    EXPECT_GT(scale, 0);
    before = scale;
  }
}

// Eq. 4.4, and its inverse by bisection.
double undistorted(double r) {
  return r * (1 + 0.22 * r * r + 0.24 * r * r * r * r);
}
double distorted(double n) {
  double low = 0, high = 1;
  for (int i = 0; i < 60; ++i) (undistorted(0.5 * (low + high)) < n ? low : high) = 0.5 * (low + high);
  return 0.5 * (low + high);
}

TEST(BarrelScale, IsTheInverseOfTheDistortion) {
  for (double n = 0.01; n <= undistorted(1); n += 0.01)
    EXPECT_NEAR(barrel_scale(n), distorted(n) / n, 0.016) << n;
  EXPECT_EQ(barrel_scale(0), 1);
}

TEST(BarrelScale, AreasKeepAtLeastTheDisplaysDensity) {
  // Seen through the lens an area shrinks by (r / n)(dr / dn).
  for (double n = 0.05; n <= undistorted(1); n += 0.01) {
    const double r = distorted(n), slope = (distorted(n + 1e-5) - distorted(n - 1e-5)) / 2e-5;
    const double fit_error = n < 0.15 ? 0.01 : 0;
    EXPECT_GE(barrel_scale(n) * barrel_scale(n), r / n * slope - fit_error) << n;
  }
}

TEST(BarrelScale, FallsAndStaysWhereItEnds) {
  double before = 1;
  for (double n = 0; n <= 4; n += 0.01) {
    EXPECT_LE(barrel_scale(n), before) << n;
    EXPECT_GE(barrel_scale(n), 0.69) << n;
    before = barrel_scale(n);
  }
  for (const double bad : {-1.0, kNan}) EXPECT_EQ(barrel_scale(bad), 1);
  EXPECT_EQ(barrel_scale(kInf), barrel_scale(10));
}

TEST(Eccentricity, OfASmallTriangleIsItsAngle) {
  const dvec3 at(std::sin(radians(30)), 0, -std::cos(radians(30)));
  const std::vector<dvec3> corners{at, at + dvec3(1e-6, 0, 0), at + dvec3(0, 1e-6, 0)};
  EXPECT_NEAR(eccentricity(corners, {}), radians(30), 2e-6);
  EXPECT_LE(eccentricity(corners, {}), radians(30));
}

TEST(Eccentricity, OfASquareEndsAtItsCorners) {
  // Seen from the middle of its plane's normal the corners lie atan(sqrt(2)/5) off the centre.
  const std::vector<dvec3> corners{{-1, -1, -5}, {1, -1, -5}, {-1, 1, -5}, {1, 1, -5}};
  const double spread = std::atan(std::sqrt(2.0) / 5);
  EXPECT_EQ(eccentricity(corners, {}), 0);
  EXPECT_NEAR(eccentricity(corners, {.direction = {1, 0, 0}}), kPi / 2 - spread, 1e-12);
  EXPECT_NEAR(eccentricity(corners, {.direction = {0, 0, 7}}), kPi - spread, 1e-12);
}

// A patch's corners at random: near and far, large and small, slivers, behind the eye and around it.
std::vector<dvec3> random_corners(std::mt19937& random) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> exponent(-3, 3);
  std::uniform_int_distribution<size_t> count(3, 5);
  const dvec3 center = dvec3(normal(random), normal(random), normal(random)) * std::pow(10, exponent(random));
  const dvec3 size(std::pow(10, exponent(random)), std::pow(10, exponent(random)),
                   std::pow(10, exponent(random)));
  std::vector<dvec3> corners(count(random));
  for (dvec3& c : corners) c = center + size * dvec3(normal(random), normal(random), normal(random));
  return corners;
}

TEST(Eccentricity, NoPointOfThePatchIsCloser) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  std::exponential_distribution<double> weight;
  int positive = 0;
  for (int i = 0; i < 2000; ++i) {
    const std::vector<dvec3> corners = random_corners(random);
    const GazeRay ray{{normal(random), normal(random), normal(random)},
                      {normal(random), normal(random), normal(random)}};
    const double e = eccentricity(corners, ray);
    ASSERT_GE(e, 0);
    ASSERT_LE(e, kPi);
    positive += e > 0;
    for (int s = 0; s < 200; ++s) {
      dvec3 point(0);
      double sum = 0;
      for (const dvec3& c : corners) {
        const double w = std::pow(weight(random), 3);  // often near an edge or a corner
        point += w * c;
        sum += w;
      }
      ASSERT_GE(angle_to(ray, point / sum), e - 1e-6) << i;  // acos keeps no more digits
    }
    for (const dvec3& c : corners) ASSERT_GE(angle_to(ray, c), e - 1e-6) << i;
  }
  EXPECT_GT(positive, 500) << "a bound of 0 proves nothing";
}

TEST(Eccentricity, IsZeroWhereTheViewerIsSurrounded) {
  const std::vector<dvec3> around{{10, 0, -1}, {-10, 5, -1}, {-10, -5, -1}};
  // The cone around them is wider than a right angle: eq. 4.3 as printed would put the gaze outside it.
  EXPECT_EQ(eccentricity(around, {.direction = {0, 0, 1}}), 0);
  const std::vector<dvec3> opposite{{1, 0, 0}, {-1, 0, 0}, {0, 1e-9, 0}};
  EXPECT_EQ(eccentricity(opposite, {}), 0);
}

TEST(Eccentricity, IsTotal) {
  const std::vector<dvec3> corners{{0, 1, -1}, {1, 1, -1}, {0, 1, -2}};
  for (const dvec3& direction : {dvec3(0), dvec3(kNan, 0, 0), dvec3(0, kInf, 0)})
    EXPECT_EQ(eccentricity(corners, {.direction = direction}), 0);
  for (const double bad : {kNan, kInf, -kInf}) {
    for (int i = 0; i < 3; ++i) {
      std::vector<dvec3> broken = corners;
      broken[i] = {bad, 1, -1};
      EXPECT_EQ(eccentricity(broken, {}), 0);
      broken[i] = {0, 1, bad};
      EXPECT_EQ(eccentricity(broken, {}), 0);
    }
  }
  EXPECT_EQ(eccentricity(corners, {.eye = corners[1]}), 0) << "the eye at a corner";
  EXPECT_EQ(eccentricity(std::vector<dvec3>(3, dvec3(0)), {}), 0);
  EXPECT_EQ(eccentricity({}, {}), 0);
  // A degenerate patch is a point, at any distance.
  for (const double distance : {1e-300, 1e-7, 1.0, 1e7, 1e300})
    EXPECT_NEAR(eccentricity(std::vector<dvec3>(3, distance * dvec3(0, 1, -1)), {}), kPi / 4, 1e-12);
}

// A row of lone triangles, one a patch, 5 m away and at growing angles to the right of the middle;
// `instances` times.
scene::Scene make_row(uint32_t patches, uint32_t instances = 1) {
  scene::Scene scene;
  scene::Geometry& g = scene.geometries.emplace_back();
  for (uint32_t p = 0; p < patches; ++p) {
    const double angle = radians(170.0 * p / patches);
    const vec3 at(5 * std::sin(angle), 0, -5 * std::cos(angle));
    for (const vec3& corner : {vec3(0), vec3(0, 0.1f, 0), vec3(0, 0, 0.1f)})
      g.vertices.push_back({.position = at + corner});
    for (uint32_t c = 0; c < 3; ++c) g.indices.push_back(3 * p + c);
    g.patches.push_back({.first_triangle = p, .triangle_count = 1});
  }
  scene.materials.emplace_back();
  scene.nodes = {{.name = "room"}, {.name = "table", .parent = 0}, {.name = "cup", .parent = 1}};
  for (uint32_t i = 0; i < instances; ++i)
    scene.instances.push_back({.geometry = 0, .material = 0, .node = i % 3});
  scene.index_instances();
  return scene;
}

VisiblePatches everything(const scene::Scene& scene) {
  VisiblePatches visible;
  for (uint32_t p = 0; p < scene.patch_count; ++p) visible.push_back({p, {10, 20, 150}});
  return visible;
}

VisiblePatches scaled(const scene::Scene& scene, const DensitySettings& settings,
                      const Viewers& viewers = {{{}}, {{}}}) {
  const auto density = Density::create(scene, settings, kDisplay);
  EXPECT_TRUE(density.ok()) << density.status();
  VisiblePatches visible = everything(scene);
  (*density)->scale(std::vector<dmat4>(scene.instances.size(), dmat4(1)), viewers, visible);
  return visible;
}

bool equal(const VisiblePatches& a, const VisiblePatches& b) {
  return std::ranges::equal(a, b, [](const auto& x, const auto& y) {
    return x.patch == y.patch && x.footprint.u_px == y.footprint.u_px &&
           x.footprint.v_px == y.footprint.v_px && x.footprint.area_px2 == y.footprint.area_px2;
  });
}

TEST(Density, ChangesNothingByDefault) {
  EXPECT_FALSE(DensitySettings{}.any());
  const scene::Scene scene = make_row(20, 3);
  EXPECT_TRUE(equal(scaled(scene, {}), everything(scene)));
}

TEST(Density, FarFromTheGazeIsNeverDenser) {
  const scene::Scene scene = make_row(60);
  for (const DensitySettings& settings : {DensitySettings{.foveated = true}, DensitySettings{.barrel = true},
                                          DensitySettings{.foveated = true, .barrel = true}}) {
    const VisiblePatches visible = scaled(scene, settings);
    for (size_t i = 1; i < visible.size(); ++i)
      EXPECT_LE(visible[i].footprint.area_px2, visible[i - 1].footprint.area_px2) << i;
    EXPECT_EQ(visible.front().footprint.area_px2, 150);
    EXPECT_LT(visible.back().footprint.area_px2, 0.66 * 150);
  }
}

TEST(Density, ScalesLengthsAndAreasByOneFactor) {
  const scene::Scene scene = make_row(30);
  const VisiblePatches visible = scaled(scene, {.foveated = true});
  for (const scene::VisiblePatch& v : visible) {
    const float factor = v.footprint.u_px / 10;
    EXPECT_FLOAT_EQ(v.footprint.v_px, 20 * factor);
    EXPECT_FLOAT_EQ(v.footprint.area_px2, 150 * factor * factor);
  }
  // The patch in the middle of the row, at 85 degrees.
  EXPECT_NEAR(visible[15].footprint.u_px / 10, foveal_scale(radians(85), kDisplay.pixels_per_radian), 1e-3);
}

TEST(Density, TheMoreDemandingViewerDecides) {
  const scene::Scene scene = make_row(40);
  const GazeRay ahead{}, aside{.eye = {0.3, 0, 0}, .direction = {1, 0, -0.2}};
  const DensitySettings settings{.foveated = true, .barrel = true};
  const VisiblePatches both = scaled(scene, settings, {{ahead, aside}, {ahead, aside}});
  const VisiblePatches one = scaled(scene, settings, {{ahead}, {ahead}});
  const VisiblePatches other = scaled(scene, settings, {{aside}, {aside}});
  bool differ = false;
  for (size_t i = 0; i < both.size(); ++i) {
    EXPECT_GE(both[i].footprint.area_px2, std::max(one[i].footprint.area_px2, other[i].footprint.area_px2))
        << i;
    differ |= one[i].footprint.area_px2 != other[i].footprint.area_px2;
  }
  EXPECT_TRUE(differ);
}

TEST(Density, WithoutAnyViewerEverythingStays) {
  const scene::Scene scene = make_row(10);
  EXPECT_TRUE(equal(scaled(scene, {.foveated = true, .barrel = true}, {}), everything(scene)));
}

TEST(Density, AGazeThatIsNoneLeavesFullDensity) {
  const scene::Scene scene = make_row(10);
  const GazeRay none{.direction = {kNan, kNan, kNan}};
  EXPECT_TRUE(equal(scaled(scene, {.foveated = true}, {{none}, {none}}), everything(scene)));
}

TEST(Density, FollowsTheInstancesTransform) {
  const scene::Scene scene = make_row(1);
  const auto density = *Density::create(scene, {.foveated = true}, kDisplay);
  VisiblePatches visible = everything(scene);
  dmat4 aside(1);
  aside[3] = glm::dvec4(5, 0, 5, 1);  // from straight ahead to 90 degrees
  density->scale(std::vector{aside}, {{{}}, {}}, visible);
  EXPECT_NEAR(visible[0].footprint.u_px / 10, foveal_scale(radians(90), kDisplay.pixels_per_radian), 2e-3);
}

TEST(Density, PrioritiesReachTheObjectsBelowTheirNode) {
  const scene::Scene scene = make_row(1, 3);  // in room, table, cup
  const auto areas = [&](const std::vector<ObjectPriority>& priorities) {
    std::vector<float> areas;
    for (const auto& v : scaled(scene, {.priorities = priorities}))
      areas.push_back(v.footprint.area_px2 / 150);
    return areas;
  };
  using testing::ElementsAre;
  using testing::FloatNear;
  EXPECT_THAT(areas({{"cup", 4}}), ElementsAre(1, 1, FloatNear(4, 1e-5)));
  EXPECT_THAT(areas({{"table", 0.25f}}), ElementsAre(1, FloatNear(0.25, 1e-5), FloatNear(0.25, 1e-5)));
  EXPECT_THAT(areas({{"room", 0.25f}, {"cup", 2}}),
              ElementsAre(FloatNear(0.25, 1e-5), FloatNear(0.25, 1e-5), FloatNear(2, 1e-5)));
}

TEST(Density, PrioritiesMultiplyWithTheGaze) {
  const scene::Scene scene = make_row(20);
  const VisiblePatches gaze = scaled(scene, {.foveated = true});
  const VisiblePatches both = scaled(scene, {.foveated = true, .priorities = {{"room", 4}}});
  for (size_t i = 0; i < gaze.size(); ++i)
    EXPECT_NEAR(both[i].footprint.area_px2, 4 * gaze[i].footprint.area_px2, 1e-3);
}

TEST(Density, RefusesPrioritiesThatCannotBe) {
  const scene::Scene scene = make_row(1);
  for (const float bad : {0.0f, -1.0f, 65.0f, std::numeric_limits<float>::quiet_NaN()}) {
    const auto density = Density::create(scene, {.priorities = {{"table", bad}}}, kDisplay);
    EXPECT_EQ(density.status().code(), absl::StatusCode::kInvalidArgument) << bad;
    EXPECT_THAT(density.status().message(), HasSubstr("`table`"));
  }
  for (const char* name : {"chair", ""}) {
    const auto density = Density::create(scene, {.priorities = {{name, 2}}}, kDisplay);
    EXPECT_EQ(density.status().code(), absl::StatusCode::kInvalidArgument) << name;
  }
}

}  // namespace
}  // namespace tessera::atlas
