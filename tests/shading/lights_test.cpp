// What the CPU decides about lights, shadows and draws.
#include <gmock/gmock.h>

#include <random>

#include "base/view.h"
#include "scene_builder.h"
#include "shading/draw_list.h"
#include "shading/light_grid.h"
#include "shading/light_list.h"
#include "shading/shadow_fit.h"

namespace tessera::shading::test {
namespace {

using scene::LightType;

scene::Light light(LightType type, float intensity, float range = 0) {
  return {.type = type, .intensity = intensity, .range = range};
}

TEST(LightPlan, OrdersByRoleAndStrength) {
  SceneBuilder b;
  b.light(light(LightType::point, 9), {}, {0, -1, 0});
  b.light(light(LightType::spot, 1), {}, {0, -1, 0});
  b.light(light(LightType::directional, 1), {}, {0, -1, 0});
  b.light(light(LightType::spot, 5), {}, {0, -1, 0});
  b.light(light(LightType::directional, 3), {}, {0, -1, 0});
  b.scene().lights.push_back(light(LightType::point, 7));  // no node carries it
  const LightPlan plan = plan_lights(b.scene(), true, 1);
  EXPECT_THAT(plan.order, testing::ElementsAre(4, 2, 3, 0, 1));
  EXPECT_EQ(plan.directional, 2u);
  EXPECT_EQ(plan.sun_shadows, 1u);
  EXPECT_EQ(plan.spot_shadows, 1u);
  EXPECT_EQ(plan.grid_lights(), 2u);
}

TEST(LightPlan, DarkSceneHasNothing) {
  const LightPlan plan = plan_lights(scene::Scene{}, true, 4);
  EXPECT_TRUE(plan.order.empty());
  EXPECT_EQ(plan.sun_shadows + plan.spot_shadows + plan.grid_lights(), 0u);
}

TEST(LightGrid, EveryPointFindsTheLightsThatReachIt) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-20, 20);
  std::vector<PlacedLight> lights;
  for (int i = 0; i < 30; ++i)
    lights.push_back({light(LightType::point, 1, i % 7 == 0 ? 0.0f : 0.5f + 0.2f * static_cast<float>(i)),
                      {uniform(random), uniform(random), uniform(random)},
                      {0, -1, 0}});
  const LightGrid grid = build_light_grid(lights);
  for (int i = 0; i < 20000; ++i) {
    const dvec3 p(1.5 * uniform(random), 1.5 * uniform(random), 1.5 * uniform(random));
    const dvec3 c = (p - grid.min) * dvec3(grid.cells_per_m);
    const bool inside =
        c.x >= 0 && c.y >= 0 && c.z >= 0 && c.x < grid.size[0] && c.y < grid.size[1] && c.z < grid.size[2];
    const glm::uvec3 u(c);
    const LightCell& cell =
        grid.cells[inside ? (u.z * grid.size[1] + u.y) * grid.size[0] + u.x : grid.outside_cell()];
    const std::span<const uint32_t> found(grid.lights.data() + cell.first, cell.count);
    for (uint32_t l = 0; l < lights.size(); ++l) {
      const float range = lights[l].light.range;
      if (range == 0 || glm::length(lights[l].position - p) <= range) {
        EXPECT_THAT(found, testing::Contains(l));
      }
    }
  }
}

TEST(LightGrid, IsSparseWhereLightsAreSmall) {
  std::vector<PlacedLight> lights;
  for (int i = 0; i < 16; ++i) lights.push_back({light(LightType::point, 1, 3), {8.0 * i, 0, 0}, {0, -1, 0}});
  const LightGrid grid = build_light_grid(lights);
  EXPECT_LT(static_cast<double>(grid.lights.size()) / static_cast<double>(grid.cells.size()), 2.0);
}

TEST(LightRecord, IsRelativeToTheOrigin) {
  scene::Light spot = light(LightType::spot, 2, 4);
  spot.inner_cone_rad = 0.2f, spot.outer_cone_rad = 0.2f;  // a hard edge
  const LightRecord r = light_record({spot, {1e7 + 1, 2, 3}, {0, -1, 0}}, {1e7, 0, 0});
  EXPECT_EQ(r.position, vec3(1, 2, 3));
  EXPECT_FLOAT_EQ(r.inverse_range, 0.25f);
  EXPECT_TRUE(std::isfinite(r.cone_scale));
  EXPECT_GT(std::cos(0.19f) * r.cone_scale + r.cone_offset, 0.9f);
}

TEST(WorldSphere, HoldsTheTransformedBall) {
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 200; ++i) {
    dmat4 m(1);
    for (int c = 0; c < 4; ++c)
      for (int r = 0; r < 3; ++r) m[c][r] = normal(random);
    const vec3 center(normal(random), normal(random), normal(random));
    const WorldSphere s = transform_sphere(m, center, 0.7f);
    for (int j = 0; j < 50; ++j) {
      const dvec3 d = 0.7 * glm::normalize(dvec3(normal(random), normal(random), normal(random)));
      EXPECT_LE(glm::length(dvec3(m * glm::dvec4(dvec3(center) + d, 1)) - s.center), s.radius * (1 + 1e-6));
    }
  }
}

TEST(Frustum, NeverDropsAVisiblePoint) {
  View view{.fov = Fov::symmetric(1, 1.5f), .width = 3, .height = 2};
  view.pose.position = {1e5, 3, -2e5};
  view.pose.orientation = glm::angleAxis(0.7, glm::normalize(dvec3(1, 2, 3)));
  const dvec3 origin = view.pose.position + dvec3(3, -2, 1);
  const mat4 clip = view_projection(view, origin);
  const Frustum frustum(clip, origin, false);
  std::mt19937 random(4);
  std::uniform_real_distribution<double> uniform(-10, 10);
  int inside = 0;
  for (int i = 0; i < 5000; ++i) {
    const dvec3 p = view.pose.position + dvec3(uniform(random), uniform(random), uniform(random));
    const vec4 c = clip * vec4(vec3(p - origin), 1);
    const bool visible = c.w > view.near_m && std::abs(c.x) < c.w && std::abs(c.y) < c.w;
    const auto side = frustum.classify({p, 0.01});
    if (visible) {
      EXPECT_NE(side, Frustum::Side::outside);
    }
    if (side == Frustum::Side::inside) {
      EXPECT_TRUE(visible);
    }
    inside += visible;
  }
  EXPECT_GT(inside, 100);
}

TEST(ShadowFit, SunIgnoresFarOutliersButKeepsTheirDepth) {
  SceneBuilder b;
  const uint32_t ground = b.rectangle({-10, 0, 10}, {20, 0, 0}, {0, 0, -20}, 24);
  const uint32_t far = b.rectangle({900, 80, 0}, {10, 0, 0}, {0, 10, 0});
  b.instance(ground, b.material({}));
  b.instance(far, 0);
  const auto scene = b.build();
  const std::vector<dmat4> transforms(2, dmat4(1));
  const ShadowFit fit = fit_sun(*scene, transforms, glm::normalize(dvec3(1, -3, 0.5)), 1024);
  EXPECT_LT(fit.texel_m * 1024, 60);
  const auto clip = [&](dvec3 p) { return fit.clip_from_world * glm::dvec4(p, 1); };
  EXPECT_GT(std::abs(clip({905, 80, 0}).x) + std::abs(clip({905, 80, 0}).y), 1);
  for (const dvec3 p : {dvec3(0, 0, 0), dvec3(900, 80, 0)}) {
    EXPECT_GE(clip(p).z, 0);
    EXPECT_LE(clip(p).z, 1);
  }
  EXPECT_GT(clip({0, 1, 0}).z, clip({0, 0, 0}).z);  // nearer to the sun is greater
}

TEST(ShadowFit, SpotCoversItsCone) {
  scene::Light spot = light(LightType::spot, 1);
  spot.outer_cone_rad = 0.5f;
  const ShadowFit fit = fit_spot({spot, {1, 2, 3}, {0, -1, 0}}, 512);
  const glm::dvec4 axis = fit.clip_from_world * glm::dvec4(1, 0, 3, 1);
  EXPECT_NEAR(axis.x / axis.w, 0, 1e-9);
  EXPECT_NEAR(axis.w, 2, 1e-6);
  const glm::dvec4 rim = fit.clip_from_world * glm::dvec4(1 + 2 * std::tan(0.5), 0, 3, 1);
  EXPECT_LT(std::hypot(rim.x / rim.w, rim.y / rim.w), 1);
  EXPECT_GT(std::hypot(rim.x / rim.w, rim.y / rim.w), 0.9);
}

}  // namespace
}  // namespace tessera::shading::test
