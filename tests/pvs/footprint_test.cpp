#include <gmock/gmock.h>

#include <cmath>

#include "pvs/visibility.h"

namespace tessera::pvs {
namespace {

constexpr float kPpr = 500;

// A patch with corners a (0,0), b (1,0), c (0,1), d (1,1).
struct Quad {
  scene::Geometry geometry;
  scene::Patch patch{0, 2};
};

Quad quad(vec3 a, vec3 b, vec3 c, vec3 d) {
  Quad q;
  for (const vec3& p : {a, b, c, d}) q.geometry.vertices.push_back({.position = p});
  q.geometry.indices = {0, 1, 2, 3, 2, 1};
  return q;
}

scene::Footprint seen_from(const Quad& q, const dvec3& eye, const dmat4& transform = dmat4(1)) {
  return footprint(q.geometry, q.patch, transform, eye, kPpr);
}

void expect_finite(const scene::Footprint& f) {
  for (const float v : {f.u_px, f.v_px, f.area_px2}) {
    EXPECT_TRUE(std::isfinite(v));
    EXPECT_GE(v, 0);
  }
}

TEST(Footprint, OfASmallSquareIsItsAngleInPixels) {
  const Quad q = quad({-1, 2, 0}, {1, 2, 0}, {-1, -2, 0}, {1, -2, 0});
  const auto f = seen_from(q, {0, 0, 1000});
  EXPECT_NEAR(f.u_px, kPpr * 2 / 1000, 1e-4);
  EXPECT_NEAR(f.v_px, kPpr * 4 / 1000, 1e-4);
  EXPECT_NEAR(f.area_px2, kPpr * kPpr * 8 / 1e6, 1e-4);
}

TEST(Footprint, TakesTheLongerOfOppositeEdges) {
  const Quad q = quad({-1, 1, 0}, {1, 1, 0}, {-3, -1, 0}, {3, -1, 0});
  const auto f = seen_from(q, {0, 0, 1000});
  EXPECT_NEAR(f.u_px, kPpr * 6 / 1000, 1e-4);
}

TEST(Footprint, DoesNotDependOnTheViewDirectionButOnTheTransform) {
  const Quad q = quad({-1, 1, 0}, {1, 1, 0}, {-1, -1, 0}, {1, -1, 0});
  dmat4 scaled(1);
  scaled[0][0] = 3;
  EXPECT_NEAR(seen_from(q, {0, 0, 1000}, scaled).u_px, kPpr * 6 / 1000, 1e-4);
  dmat4 shifted(1);
  shifted[3] = glm::dvec4(1e6, 0, 0, 1);
  EXPECT_NEAR(seen_from(q, {1e6, 0, 1000}, shifted).u_px, kPpr * 2 / 1000, 1e-4);
}

TEST(Footprint, OfPatchesOfOneAndThreeTriangles) {
  Quad one = quad({0, 0, 0}, {1, 0, 0}, {0, -2, 0}, {});
  one.patch.triangle_count = 1;
  const auto f = seen_from(one, {0, 0, 1000});
  EXPECT_NEAR(f.u_px, 0.5, 1e-4);
  EXPECT_NEAR(f.v_px, 1.0, 1e-4);
  EXPECT_NEAR(f.area_px2, 0.25, 1e-4);

  // thesis fig. 3.4: top left, top right, bottom middle; then the left and right triangles.
  Quad three;
  for (const vec3& p : {vec3(0, 0, 0), vec3(1, 0, 0), vec3(.5f, -1, 0), vec3(0, -1, 0), vec3(1, -1, 0)}) {
    three.geometry.vertices.push_back({.position = p});
  }
  three.geometry.indices = {0, 1, 2, 3, 0, 2, 1, 4, 2};
  three.patch = {0, 3};
  const auto g = seen_from(three, {0.5, -0.5, 1000});
  EXPECT_NEAR(g.u_px, 0.5, 1e-4);
  EXPECT_NEAR(g.v_px, 0.5, 1e-4);
  EXPECT_NEAR(g.area_px2, 0.25, 1e-4);
}

TEST(Footprint, OfAnEyeInThePatchIsFinite) {
  const Quad q = quad({-1, 1, 0}, {1, 1, 0}, {-1, -1, 0}, {1, -1, 0});
  for (const dvec3& eye :
       {dvec3(0), dvec3(-1, 1, 0), dvec3(0, 1, 0), dvec3(0.5, 0.2, 0), dvec3(0, 0, 1e-300)}) {
    expect_finite(seen_from(q, eye));
  }
  // The edge passes through the eye: its ends are half a turn apart.
  EXPECT_NEAR(seen_from(q, {0, 1, 0}).u_px, kPpr * M_PI, 1e-2);
}

TEST(Footprint, KeepsItsDigitsFarAwayAndForTinyPatches) {
  const float s = 1e-3f;
  const Quad q = quad({-s, s, 0}, {s, s, 0}, {-s, -s, 0}, {s, -s, 0});
  const auto f = seen_from(q, {0, 0, 1e7});
  EXPECT_NEAR(f.u_px / (kPpr * 2e-3 / 1e7), 1, 1e-5);
  EXPECT_NEAR(f.area_px2 / (kPpr * kPpr * 4e-6 / 1e14), 1, 1e-4);

  dmat4 far(1);
  far[3] = glm::dvec4(1e7, 1e7, 1e7, 1);
  const auto g = seen_from(q, {1e7, 1e7, 1e7 + 1}, far);
  EXPECT_NEAR(g.u_px / (kPpr * 2e-3), 1, 1e-4);
}

TEST(Footprint, OfSliversHasTheRightArea) {
  const float thin = 1e-7f;
  const Quad q = quad({-1, thin, 0}, {1, thin, 0}, {-1, 0, 0}, {1, 0, 0});
  const auto f = seen_from(q, {0, 0, 100});
  expect_finite(f);
  EXPECT_NEAR(f.area_px2 / (kPpr * kPpr * 2e-7 / 1e4), 1, 0.05);
  const Quad flat = quad({-1, 0, 0}, {1, 0, 0}, {-1, 0, 0}, {1, 0, 0});
  EXPECT_NEAR(seen_from(flat, {0, 0, 100}).area_px2, 0, 1e-6);
}

TEST(Footprint, OfExtremeCoordinatesIsFinite) {
  for (const float size : {1e-38f, 1e-20f, 1e20f, 3e38f}) {
    const Quad q = quad({-size, size, 0}, {size, size, 0}, {-size, -size, 0}, {size, -size, 0});
    for (const double distance : {0.0, 1e-30, 1.0, 1e30}) expect_finite(seen_from(q, {0, 0, distance}));
  }
}

// Exactly the area of a spherical octant's flat triangle with sides of a quarter turn.
TEST(Footprint, OfAHugeTriangleUsesItsAngularSides) {
  Quad q = quad({1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {});
  q.patch.triangle_count = 1;
  const auto f = seen_from(q, dvec3(0));
  EXPECT_NEAR(f.u_px, kPpr * M_PI / 2, 1e-2);
  EXPECT_NEAR(f.area_px2, kPpr * kPpr * std::sqrt(3.0) / 4 * M_PI * M_PI / 4, 1);
}

}  // namespace
}  // namespace tessera::pvs
