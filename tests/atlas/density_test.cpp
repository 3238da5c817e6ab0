#include "atlas/density.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
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
  // Twice the foveation: half the samples.
  EXPECT_NEAR(foveal_scale(radians(20), kThesisPixelsPerRadian, 2), 0.5 / 4.9155556, 1e-7);
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
  const std::vector<dvec3> triangle{at, at + dvec3(1e-6, 0, 0), at + dvec3(0, 1e-6, 0)};
  EXPECT_NEAR(eccentricity(triangle, {}), radians(30), 2e-6);
}

TEST(Eccentricity, OfASquareIsThatOfItsNearestPoint) {
  const dvec3 a(-1, -1, -5), b(1, -1, -5), c(-1, 1, -5), d(1, 1, -5);
  const std::vector<dvec3> square{a, b, c, d, c, b};
  EXPECT_EQ(eccentricity(square, {}), 0);
  EXPECT_EQ(eccentricity(square, {.direction = {0.1, -0.1, -1}}), 0);
  // The middle of its right edge, a corner, and an inner point of its upper edge.
  EXPECT_NEAR(eccentricity(square, {.direction = {1, 0, 0}}), kPi / 2 - std::atan(1.0 / 5), 1e-12);
  EXPECT_NEAR(eccentricity(square, {.direction = {0, 0, 7}}), kPi - std::atan(std::sqrt(2.0) / 5), 1e-12);
  EXPECT_NEAR(
      eccentricity(square, {.direction = {0.5, 5, -5}}),
      std::asin(std::abs(glm::dot(glm::normalize(dvec3(0.5, 5, -5)), glm::normalize(dvec3(0, 5, 1))))),
      1e-12);
}

TEST(Eccentricity, OfWhatSurroundsTheViewer) {
  // The cone around these corners is wider than a right angle, for which eq. 4.3 was not made.
  const std::vector<dvec3> around{{10, 0, -1}, {-10, 5, -1}, {-10, -5, -1}};
  EXPECT_EQ(eccentricity(around, {}), 0);
  EXPECT_NEAR(eccentricity(around, {.direction = {0, 0, 1}}), kPi / 2 + std::atan(1 / std::sqrt(125.0)),
              1e-12);
}

// Triangles at random, as of a patch: near and far, large and small, slivers, behind the eye and around it.
std::vector<dvec3> random_triangles(std::mt19937& random) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> exponent(-3, 3);
  std::uniform_int_distribution<size_t> count(1, 3);
  const auto size = [&] { return std::pow(10, exponent(random)); };
  const dvec3 center = dvec3(normal(random), normal(random), normal(random)) * size();
  const dvec3 extent(size(), size(), size());
  std::vector<dvec3> triangles(3 * count(random));
  for (dvec3& c : triangles) c = center + extent * dvec3(normal(random), normal(random), normal(random));
  return triangles;
}

// Eq. 4.3 as printed; nothing where its cone is none.
std::optional<double> printed_bound(const std::vector<dvec3>& corners, const GazeRay& ray) {
  dvec3 center(0);
  for (const dvec3& c : corners) center += glm::normalize(c - ray.eye);
  const GazeRay to_center{.eye = ray.eye, .direction = center};
  double spread = 0;
  for (const dvec3& c : corners) spread = std::max(spread, angle_to(to_center, c));
  if (spread > 1.5) return std::nullopt;
  return std::max(0.0, angle_to(ray, ray.eye + center) - spread);
}

TEST(Eccentricity, NoPointOfThePatchIsCloserAndEquation43BoundsIt) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  std::exponential_distribution<double> weight;
  int positive = 0, bounded = 0;
  for (int i = 0; i < 3000; ++i) {
    const std::vector<dvec3> triangles = random_triangles(random);
    const GazeRay ray{{normal(random), normal(random), normal(random)},
                      {normal(random), normal(random), normal(random)}};
    const double e = eccentricity(triangles, ray);
    ASSERT_GE(e, 0);
    ASSERT_LE(e, kPi);
    positive += e > 0;
    double nearest = kPi;
    for (int s = 0; s < 300; ++s) {
      const size_t t = 3 * (s % (triangles.size() / 3));
      dvec3 point(0);
      double sum = 0;
      for (size_t c = 0; c < 3; ++c) {
        const double w = s < 9 ? static_cast<double>(s % 3 == static_cast<int>(c))  // a corner
                               : std::pow(weight(random), 3);                       // often near an edge
        point += w * triangles[t + c];
        sum += w;
      }
      nearest = std::min(nearest, angle_to(ray, point / sum));
    }
    ASSERT_GE(nearest, e - 1e-6) << i;  // acos keeps no more digits
    if (const auto bound = printed_bound(triangles, ray)) {
      ASSERT_GE(e, *bound - 1e-6) << i;
      bounded += *bound > 0;
    }
  }
  EXPECT_GT(positive, 1000) << "a bound of 0 proves nothing";
  EXPECT_GT(bounded, 300);
}

TEST(Eccentricity, IsTotal) {
  const std::vector<dvec3> triangle{{0, 1, -1}, {1, 1, -1}, {0, 1, -2}};
  for (const dvec3& direction : {dvec3(0), dvec3(kNan, 0, 0), dvec3(0, kInf, 0)})
    EXPECT_EQ(eccentricity(triangle, {.direction = direction}), 0);
  for (const double bad : {kNan, kInf, -kInf}) {
    for (int i = 0; i < 3; ++i) {
      for (int axis = 0; axis < 3; ++axis) {
        std::vector<dvec3> broken = triangle;
        broken[i][axis] = bad;
        EXPECT_EQ(eccentricity(broken, {}), 0);
      }
    }
  }
  EXPECT_EQ(eccentricity(triangle, {.eye = triangle[1]}), 0) << "the eye at a corner";
  EXPECT_EQ(eccentricity(std::vector<dvec3>(3, dvec3(0)), {}), 0);
  EXPECT_EQ(eccentricity({}, {}), 0);
  // A degenerate patch is a point or a line, at any distance.
  for (const double distance : {1e-300, 1e-7, 1.0, 1e7, 1e300}) {
    EXPECT_NEAR(eccentricity(std::vector<dvec3>(3, distance * dvec3(0, 1, -1)), {}), kPi / 4, 1e-12);
    const std::vector<dvec3> line{distance * dvec3(-1, 1, -1), distance * dvec3(1, 1, -1),
                                  distance * dvec3(0, 1, -1)};
    EXPECT_NEAR(eccentricity(line, {}), kPi / 4, 1e-12);
  }
  // The eye in the triangle's plane sees a line, which may pass the gaze.
  const std::vector<dvec3> edge_on{{-1, 0, -1}, {1, 0, -1}, {0, 0, -3}};
  EXPECT_NEAR(eccentricity(edge_on, {}), 0, 1e-7);
  EXPECT_NEAR(eccentricity(edge_on, {.direction = {0, 1, 0}}), kPi / 2, 1e-7);
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
  for (const DensitySettings& settings : {DensitySettings{.foveation = 1}, DensitySettings{.barrel = true},
                                          DensitySettings{.foveation = 1, .barrel = true}}) {
    const VisiblePatches visible = scaled(scene, settings);
    for (size_t i = 1; i < visible.size(); ++i)
      EXPECT_LE(visible[i].footprint.area_px2, visible[i - 1].footprint.area_px2) << i;
    EXPECT_EQ(visible.front().footprint.area_px2, 150);
    EXPECT_LT(visible.back().footprint.area_px2, 0.66 * 150);
  }
}

TEST(Density, ScalesLengthsAndAreasByOneFactor) {
  const scene::Scene scene = make_row(30);
  const VisiblePatches visible = scaled(scene, {.foveation = 1});
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
  const DensitySettings settings{.foveation = 1, .barrel = true};
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

// A movement's rays, most of which a patch need not be looked at for.
TEST(Density, OfManyViewersTheMostDemandingDecides) {
  const scene::Scene scene = make_row(60);
  const DensitySettings settings{.foveation = 1};
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (int run = 0; run < 20; ++run) {
    std::vector<GazeRay> rays;
    std::vector<float> most(scene.patch_count);
    const dvec3 axis(normal(random), normal(random), normal(random));
    for (int r = 0; r < 12; ++r) {
      const dquat turn = glm::angleAxis(0.1 * r, glm::normalize(axis));
      rays.push_back({0.2 * r * axis, turn * dvec3(0.3, 0, -2)});
      const VisiblePatches one = scaled(scene, settings, {{rays.back()}, {}});
      for (size_t p = 0; p < most.size(); ++p) most[p] = std::max(most[p], one[p].footprint.area_px2);
    }
    const VisiblePatches all = scaled(scene, settings, {rays, {}});
    for (size_t p = 0; p < most.size(); ++p) EXPECT_FLOAT_EQ(all[p].footprint.area_px2, most[p]) << p;
  }
}

TEST(Density, WithoutAnyViewerEverythingStays) {
  const scene::Scene scene = make_row(10);
  EXPECT_TRUE(equal(scaled(scene, {.foveation = 1, .barrel = true}, {}), everything(scene)));
}

TEST(Density, AGazeThatIsNoneLeavesFullDensity) {
  const scene::Scene scene = make_row(10);
  const GazeRay none{.direction = {kNan, kNan, kNan}};
  EXPECT_TRUE(equal(scaled(scene, {.foveation = 1}, {{none}, {none}}), everything(scene)));
}

TEST(Density, FollowsTheInstancesTransform) {
  const scene::Scene scene = make_row(1);
  const auto density = *Density::create(scene, {.foveation = 1}, kDisplay);
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
  const VisiblePatches gaze = scaled(scene, {.foveation = 1});
  const VisiblePatches both = scaled(scene, {.foveation = 1, .priorities = {{"room", 4}}});
  for (size_t i = 0; i < gaze.size(); ++i)
    EXPECT_NEAR(both[i].footprint.area_px2, 4 * gaze[i].footprint.area_px2, 1e-3);
}

TEST(Density, RefusesAFoveationThatCannotBe) {
  const scene::Scene scene = make_row(1);
  for (const float bad : {-1.0f, 8.1f, std::numeric_limits<float>::quiet_NaN()})
    EXPECT_EQ(Density::check(scene, {.foveation = bad}).code(), absl::StatusCode::kInvalidArgument) << bad;
}

// The samples that an ideal shader would take of a picture, per pixel: of the solid angle of each of its
// pixels by the density there.
double ideal_share(double foveation) {
  double samples = 0;
  constexpr int kWidth = 320, kHeight = 180;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double right = 2 * (x + 0.5) / kWidth - 1, up = (2 * (y + 0.5) / kHeight - 1) * 9 / 16;
      const double square = 1 + right * right + up * up;
      const double solid = (2.0 / kWidth) * (2.0 / kHeight * 9 / 16) / std::pow(square, 1.5);
      const double scale = foveal_scale(std::acos(1 / std::sqrt(square)), kThesisPixelsPerRadian, foveation);
      samples += solid * std::pow(kThesisPixelsPerRadian * scale, 2);
    }
  }
  return samples / (1920 * 1080);
}

TEST(FovealScale, OfAWholePicture) {
  EXPECT_NEAR(ideal_share(1), 0.057, 0.0005);
  EXPECT_NEAR(ideal_share(2), 0.016, 0.0005);
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
