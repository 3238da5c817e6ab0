#include "server/frame_plan.h"

#include <algorithm>

#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

namespace tessera::server {
namespace {

PlannedPass counted(const std::string& name, uint32_t count, const std::string& what) {
  return {name, count > 0, count > 0 ? absl::StrFormat("%d %s", count, what) : "no " + what};
}

PlannedPass needed(const std::string& name, bool is_needed, const std::string& what) {
  return {name, is_needed, (is_needed ? "the scene has " : "the scene has no ") + what};
}

PlannedPass density_pass(const atlas::DensitySettings& density) {
  std::vector<std::string> causes;
  if (density.foveation > 0) causes.push_back("foveation");
  if (density.barrel) causes.push_back("barrel distortion");
  if (const size_t count = density.priorities.size(); count > 0)
    causes.push_back(absl::StrFormat("%d object priorities", count));
  if (causes.empty()) return {"density", false, "the session has neither foveation, lens nor priorities"};
  return {"density", true, "the session has " + absl::StrJoin(causes, ", ")};
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

FramePlan make_frame_plan(const scene::Features& features, const atlas::DensitySettings& density) {
  FramePlan plan;
  plan.passes = {
      needed("object_transforms", features.rigid_animation, "moving objects"),
      counted("sun_shadow", features.directional_lights, "directional lights"),
      counted("spot_shadows", features.spot_lights, "spot lights"),
      {"culling", true, "always: meshlets against frustum and depth"},
      {"id_opaque", true, "always"},
      needed("id_masked", features.alpha_mask, "alpha-masked materials"),
      density_pass(density),
      {"layout", true, "always: sizes and places in the atlas"},
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
