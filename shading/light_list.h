// A scene's lights as shading wants them: in order of treatment, in world coordinates.
#pragma once

#include <cstdint>
#include <vector>

#include "scene/scene.h"
#include "shading/light_records.h"

namespace tessera::shading {

constexpr uint32_t kMaxDirectional = 8;
constexpr uint32_t kMaxSpotShadows = kMaxLeadingLights - kMaxDirectional;

// Roles are fixed when a scene is loaded; only places change with time.
struct LightPlan {
  // Indices into Scene::lights: directional ones, the strongest first; shadowed spots, likewise; all others.
  // Lights that no node carries are left out, and the weakest where there are more than kMaxDirectional
  // directional or kMaxGridLights other lights.
  std::vector<uint32_t> order;
  uint32_t directional = 0, sun_shadows = 0, spot_shadows = 0;

  uint32_t first_grid_light() const { return directional + spot_shadows; }
  uint32_t grid_lights() const { return static_cast<uint32_t>(order.size()) - first_grid_light(); }
};

LightPlan plan_lights(const scene::Scene& scene, bool sun_shadow, uint32_t max_spot_shadows);

struct PlacedLight {
  scene::Light light;
  dvec3 position;   // world
  dvec3 direction;  // unit, the way it shines
};

// In the plan's order. `nodes`: world matrices (Scene::node_transforms).
std::vector<PlacedLight> place_lights(const scene::Scene& scene, const LightPlan& plan,
                                      const std::vector<dmat4>& nodes);

LightRecord light_record(const PlacedLight& placed, const dvec3& origin);

}  // namespace tessera::shading
