#include "server/frame_plan.h"

#include <gtest/gtest.h>

namespace tessera::server {
namespace {

TEST(FramePlan, EmptySceneNeedsNoOptionalPass) {
  const FramePlan plan = make_frame_plan({});
  for (const char* pass :
       {"object_transforms", "sun_shadow", "spot_shadows", "id_masked", "coverage", "normal_maps", "blend"}) {
    EXPECT_FALSE(plan.includes(pass)) << pass;
  }
  for (const char* pass : {"culling", "id_opaque", "layout", "gather", "encode"})
    EXPECT_TRUE(plan.includes(pass)) << pass;
}

TEST(FramePlan, EachFeatureBringsItsPass) {
  EXPECT_TRUE(make_frame_plan({.directional_lights = 1}).includes("sun_shadow"));
  EXPECT_TRUE(make_frame_plan({.spot_lights = 2}).includes("spot_shadows"));
  EXPECT_TRUE(make_frame_plan({.alpha_mask = true}).includes("id_masked"));
  EXPECT_TRUE(make_frame_plan({.alpha_mask = true}).includes("coverage"));
  EXPECT_TRUE(make_frame_plan({.normal_maps = true}).includes("normal_maps"));
  EXPECT_TRUE(make_frame_plan({.rigid_animation = true}).includes("object_transforms"));
}

TEST(FramePlan, DensityIsLeftOutUnlessTheSessionAsksForIt) {
  EXPECT_FALSE(make_frame_plan({}).includes("density"));
  for (const atlas::DensitySettings& density :
       {atlas::DensitySettings{.foveation = 1}, atlas::DensitySettings{.barrel = true},
        atlas::DensitySettings{.priorities = {{"table", 2}}}}) {
    EXPECT_TRUE(density.any());
    EXPECT_TRUE(make_frame_plan({}, density).includes("density"));
  }
  const std::string text = make_frame_plan({}, {.foveation = 1, .barrel = true}).to_string();
  EXPECT_NE(text.find("foveation, barrel distortion"), std::string::npos) << text;
}

TEST(FramePlan, EveryPassHasAReason) {
  for (const PlannedPass& pass : make_frame_plan({}).passes) EXPECT_FALSE(pass.reason.empty()) << pass.name;
  const std::string text = make_frame_plan({.spot_lights = 3}).to_string();
  EXPECT_NE(text.find("3 spot lights"), std::string::npos);
  EXPECT_NE(text.find("out blend"), std::string::npos);
}

}  // namespace
}  // namespace tessera::server
