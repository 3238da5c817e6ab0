#include "bench/memory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "silent_run.h"

namespace tessera::bench {
namespace {

using testing::HasSubstr;

StatusOr<MemoryResult> run(const MemorySettings& settings) {
  return run_silently(run_memory, settings);
}

MemorySettings small_settings() {
  MemorySettings settings;
  settings.speed = {.patches = {300, 900}, .frames = 2};
  settings.shared.scene = "city:20000";
  settings.shared.path = "city";
  settings.shared.size = {160, 90};
  settings.shared.atlas = {256, 256};
  settings.frames = 6;
  return settings;
}

TEST(Memory, DeviceAndProcessorAgreeAndEveryTexelIsSomewhere) {
  const auto result = run(small_settings());
  ASSERT_TRUE(result.ok()) << result.status();
  ASSERT_EQ(result->speed.size(), 2u);
  for (const SpeedRow& row : result->speed) {
    EXPECT_EQ(row.differing_blocks, 0u);
    EXPECT_EQ(row.out_of_memory, 0u);
    EXPECT_EQ(row.requests, row.patches / 10) << "5 % leave, 5 % come";
    EXPECT_GT(row.phases.p50, 0);
    EXPECT_GE(row.cpu.p50, row.phases.p50);
    EXPECT_GT(row.gpu.p50, 0);
    EXPECT_GT(row.layout.p50, 0);
  }
  ASSERT_EQ(result->strategies.size(), 4u);
  for (const StrategyRow& row : result->strategies) {
    EXPECT_EQ(row.frames, 6u);
    EXPECT_NEAR(row.used + row.carried + row.stacks + row.inaccessible + row.free, 1, 1e-9);
    EXPECT_GT(row.used, 0);
    EXPECT_GT(row.blocks, 0);
  }
  EXPECT_EQ(result->strategies[0].inaccessible, 0);
  EXPECT_LT(result->strategies[0].carried, result->strategies[1].carried);

  const nlohmann::json json = to_json(*result);
  EXPECT_EQ(json["schema"], kSchema);
  EXPECT_EQ(json["rows"].size(), 6u);
  EXPECT_EQ(json["rows"][1]["patches"], 900);
  EXPECT_EQ(json["rows"][5]["strategy"], "S3");
  EXPECT_EQ(json["settings"]["frames"], 6);
  EXPECT_THAT(to_text(*result), HasSubstr("S2"));
}

TEST(Memory, PartsCanBeLeftOut) {
  MemorySettings settings = small_settings();
  settings.speed.patches = {0};
  settings.frames = 0;
  const auto result = run(settings);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_TRUE(result->speed.empty());
  EXPECT_TRUE(result->strategies.empty());
  EXPECT_EQ(to_text(*result), "");
}

TEST(Memory, FlagsGiveTheSameSettings) {
  MemorySettings settings = small_settings();
  settings.shared.fps = LoopbackSettings{}.fps;  // the default of other commands, but not of this one
  MemorySettings parsed;
  CLI::App app;
  add_options(app, parsed);
  std::vector<std::string> flags = to_flags(settings);
  app.parse(std::vector<std::string>(flags.rbegin(), flags.rend()));
  EXPECT_EQ(parsed.shared, settings.shared);
  EXPECT_EQ(parsed.speed.patches, settings.speed.patches);
  EXPECT_EQ(parsed.speed.churn, settings.speed.churn);
  EXPECT_EQ(parsed.speed.frames, settings.speed.frames);
  EXPECT_EQ(parsed.frames, settings.frames);
}

TEST(Memory, RejectsAnAtlasThatSuperblocksDoNotFit) {
  MemorySettings settings = small_settings();
  settings.speed.patches.clear();
  settings.shared.atlas = {264, 256};
  EXPECT_EQ(run(settings).status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace tessera::bench
