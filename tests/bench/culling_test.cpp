#include "bench/culling.h"

#include <gtest/gtest.h>

#include "silent_run.h"

namespace tessera::bench {
namespace {

TEST(Culling, LeavesTheVisibleSetAndSpareTriangles) {
  LoopbackSettings settings;
  settings.scene = "city:20000";
  settings.path = "city";
  settings.seconds = 0.1;
  settings.size = {160, 90};
  const auto result = run_silently(run_culling, settings);
  ASSERT_TRUE(result.ok()) << result.status();
  ASSERT_EQ(result->frames.size(), 3u);
  EXPECT_EQ(result->differing_patches(), 0u);
  for (const CullingFrame& frame : result->frames) {
    EXPECT_GT(frame.patches, 0u);
    EXPECT_LT(frame.culled_triangles, frame.all_triangles);
    EXPECT_GT(frame.culled_ms, 0);
  }
}

}  // namespace
}  // namespace tessera::bench
