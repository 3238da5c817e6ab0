#include "server/frame_plan.h"

#include <algorithm>

#include "absl/strings/str_format.h"

namespace tessera::server {
namespace {

PlannedPass counted(const std::string& name, uint32_t count, const std::string& what) {
  return {name, count > 0, count > 0 ? absl::StrFormat("%d %s", count, what) : "no " + what};
}

PlannedPass needed(const std::string& name, bool is_needed, const std::string& what) {
  return {name, is_needed, (is_needed ? "the scene has " : "the scene has no ") + what};
}

}  // namespace

bool FramePlan::includes(const std::string& name) const {
  const auto pass =
      std::find_if(passes.begin(), passes.end(), [&](const PlannedPass& p) { return p.name == name; });
  return pass != passes.end() && pass->included;
}

std::string FramePlan::to_string() const {
  std::string text;
  for (const PlannedPass& pass : passes) {
    absl::StrAppendFormat(&text, "%-3s %-18s %s\n", pass.included ? "in" : "out", pass.name, pass.reason);
  }
  return text;
}

FramePlan make_frame_plan(const scene::Features& features) {
  FramePlan plan;
  plan.passes = {
      needed("object_transforms", features.rigid_animation, "moving objects"),
      counted("sun_shadow", features.directional_lights, "directional lights"),
      counted("spot_shadows", features.spot_lights, "spot lights"),
      {"culling", true, "always: meshlets against frustum and depth"},
      {"id_opaque", true, "always"},
      needed("id_masked", features.alpha_mask, "alpha-masked materials"),
      {"layout", true, "always: levels and block memory"},
      {"gather", true, "always: shades the placed samples"},
      needed("coverage", features.alpha_mask, "alpha-masked materials"),
      needed("normal_maps", features.normal_maps, "normal maps"),
      needed("blend", false, "pass for blended materials: they are drawn opaque"),
      {"color_conversion", true, "H.264 codes Y'CbCr 4:2:0"},
      {"encode", true, "always"},
  };
  return plan;
}

}  // namespace tessera::server
