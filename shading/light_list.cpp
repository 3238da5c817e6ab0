#include "shading/light_list.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tessera::shading {
namespace {

float strength(const scene::Light& light) {
  return light.intensity * std::max({light.color.r, light.color.g, light.color.b});
}

}  // namespace

LightPlan plan_lights(const scene::Scene& scene, bool sun_shadow, uint32_t max_spot_shadows) {
  using scene::LightType;
  std::vector<uint32_t> by_type[3];
  for (uint32_t i = 0; i < scene.lights.size(); ++i)
    if (scene.lights[i].node < scene.nodes.size())
      by_type[static_cast<uint32_t>(scene.lights[i].type)].push_back(i);
  auto& [suns, points, spots] = by_type;
  const auto stronger = [&](uint32_t a, uint32_t b) {
    return strength(scene.lights[a]) > strength(scene.lights[b]);
  };
  std::stable_sort(suns.begin(), suns.end(), stronger);
  std::stable_sort(spots.begin(), spots.end(), stronger);

  suns.resize(std::min<size_t>(suns.size(), kMaxDirectional));
  LightPlan plan;
  plan.directional = static_cast<uint32_t>(suns.size());
  plan.sun_shadows = sun_shadow && !suns.empty() ? 1 : 0;
  plan.spot_shadows = std::min({static_cast<uint32_t>(spots.size()), max_spot_shadows, kMaxSpotShadows});
  const auto first_other = spots.begin() + plan.spot_shadows;
  std::vector<uint32_t> others(first_other, spots.end());
  spots.erase(first_other, spots.end());
  others.insert(others.end(), points.begin(), points.end());
  std::stable_sort(others.begin(), others.end(), stronger);
  others.resize(std::min<size_t>(others.size(), kMaxGridLights));
  for (const auto* part : {&suns, &spots, &others})
    plan.order.insert(plan.order.end(), part->begin(), part->end());
  return plan;
}

std::vector<PlacedLight> place_lights(const scene::Scene& scene, const LightPlan& plan,
                                      const std::vector<dmat4>& nodes) {
  std::vector<PlacedLight> placed;
  placed.reserve(plan.order.size());
  for (uint32_t index : plan.order) {
    const scene::Light& light = scene.lights[index];
    const dmat4& node = nodes[light.node];
    const dvec3 axis = -dvec3(node[2]);
    const double length = glm::length(axis);
    placed.push_back({light, dvec3(node[3]), length > 0 ? axis / length : dvec3(0, -1, 0)});
  }
  return placed;
}

LightRecord light_record(const PlacedLight& placed, const dvec3& origin) {
  const scene::Light& light = placed.light;
  LightRecord r{};
  r.position = vec3(placed.position - origin);
  r.inverse_range = light.range > 0 ? 1 / light.range : 0;
  r.direction = vec3(placed.direction);
  r.color = light.color * light.intensity;
  r.cone_offset = 1;  // with scale 0: shines everywhere
  if (light.type == scene::LightType::spot) {
    const float outer = std::clamp(light.outer_cone_rad, 1e-3f, std::numbers::pi_v<float> / 2);
    const float inner = std::clamp(light.inner_cone_rad, 0.0f, outer);
    // KHR_lights_punctual, "Inner and outer cone angles".
    r.cone_scale = 1 / std::max(0.001f, std::cos(inner) - std::cos(outer));
    r.cone_offset = -std::cos(outer) * r.cone_scale;
  }
  return r;
}

}  // namespace tessera::shading
