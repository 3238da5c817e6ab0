#include "bench/settings.h"

#include <stdlib.h>

#include <gtest/gtest.h>
#include <CLI/CLI.hpp>
#include <fstream>
#include <nlohmann/json.hpp>

#include "bench/file_io.h"
#include "bench/temporary_folder.h"

namespace tessera::bench {
namespace {

// Throws CLI::ParseError on wrong usage.
LoopbackSettings parse(std::vector<std::string> flags) {
  CLI::App app;
  LoopbackSettings settings;
  add_options(app, settings);
  std::reverse(flags.begin(), flags.end());  // CLI11 takes them last first
  app.parse(flags);
  return settings;
}

// Every field differs from its default.
LoopbackSettings unusual() {
  LoopbackSettings s;
  s.scene = "a scene.glb";
  s.clock = "real";
  s.sessions = 3;
  s.frames_csv = "frames.csv";
  s.trace = "trace.json";
  s.path = "p.csv";
  s.start_s = 1.5;
  s.seconds = 3.25;
  s.fps = 72;
  s.size = {1280, 720};
  s.fov_y_deg = 75.5;
  s.server_fps = 15;
  s.server_ms = 12.125;
  s.atlas = {4096, 2048};
  s.layout = atlas::LayoutKind::tessellated;
  s.codec = AtlasCodec::jpeg;
  s.bitrate_mbps = 7.5;
  s.pvs = Prediction::none;
  s.gather = shading::GatherPath::raster;
  s.device = "some gpu";
  s.validation = !s.validation;
  s.delay_ms = 20;
  s.jitter_ms = 10;
  s.loss = 0.015625;
  s.seed = 18446744073709551615u;
  s.score_every = 4;
  s.truth = Truth::one;
  s.split = false;
  s.baselines = {"mesh-warp"};
  s.truth_cache = "none";
  s.json = "out.json";
  s.report = "folder";
  s.estimate_only = true;
  return s;
}

TEST(Settings, DefaultsAreTheDocumentedOnes) {
  const LoopbackSettings s = parse({});
  EXPECT_EQ(s, LoopbackSettings{});
  const nlohmann::json j = to_json(s);
  EXPECT_EQ(j["size"], "960x540");
  EXPECT_EQ(j["atlas"], "2048x1024");
  EXPECT_EQ(j["server-fps"], 30);
  EXPECT_EQ(j["bitrate-mbps"], 20);
  EXPECT_EQ(j["codec"], "h264");
  EXPECT_EQ(j["truth"], "4x");
}

TEST(Settings, FlagsReadBackAsTheSameSettings) {
  EXPECT_TRUE(to_flags(LoopbackSettings{}).empty());
  EXPECT_EQ(parse(to_flags(unusual())), unusual());
}

TEST(Settings, TheTestCoversEveryOption) {
  const nlohmann::json defaults = to_json(LoopbackSettings{}), changed = to_json(unusual());
  for (const auto& [name, value] : defaults.items()) {
    EXPECT_NE(changed[name], value) << name;
  }
}

TEST(Settings, ConfigFileIsTheSameAsFlags) {
  const TemporaryFolder folder;
  const auto file = folder.path() / "bench.toml";
  std::string text = "[loopback]\n";
  const nlohmann::json values = to_json(unusual());
  for (const auto& [name, value] : values.items()) absl::StrAppend(&text, name, " = ", value.dump(), "\n");
  ASSERT_TRUE(write_file(file, text).ok());

  CLI::App app;
  app.set_config("--config");
  LoopbackSettings settings;
  CLI::App* loopback = app.add_subcommand("loopback");
  loopback->fallthrough();
  add_options(*loopback, settings);
  app.parse("loopback --config " + file.string() + " --fps 90");
  LoopbackSettings expected = unusual();
  expected.fps = 90;  // flags win
  EXPECT_EQ(settings, expected);
}

TEST(Settings, EnvironmentVariables) {
  setenv("TESSERA_BENCH_DELAY_MS", "80", 1);
  setenv("TESSERA_BENCH_SIZE", "640x360", 1);
  const LoopbackSettings s = parse({"--size=320x180"});
  unsetenv("TESSERA_BENCH_DELAY_MS");
  unsetenv("TESSERA_BENCH_SIZE");
  EXPECT_EQ(s.delay_ms, 80);
  EXPECT_EQ(s.size, (Size{320, 180}));
}

TEST(Settings, WrongValuesAreRefused) {
  for (const char* flag :
       {"--fps=0",          "--fps=abc",       "--size=960",        "--size=961x540",     "--size=0x540",
        "--size=960x540x3", "--size=-960x540", "--atlas=2044x1024", "--atlas=99999x1024", "--loss=0.9",
        "--loss=-1",        "--fov-y=180",     "--codec=mp3",       "--layout=none",      "--pvs=magic",
        "--truth=2x",       "--baselines=atw", "--score-every=0",   "--seconds=0",        "--clock=sundial",
        "--unknown=1",      "--split=maybe",   "--server-ms=-1",    "--seed=-1"}) {
    EXPECT_THROW(parse({flag}), CLI::ParseError) << flag;
  }
}

TEST(Settings, BaselineListsAndSwitches) {
  const LoopbackSettings both =
      parse({"--baselines=mesh-warp,plain-video", "--split=off", "--estimate-only"});
  EXPECT_TRUE(both.wants_baseline("mesh-warp"));
  EXPECT_TRUE(both.wants_baseline("plain-video"));
  EXPECT_FALSE(both.split);
  EXPECT_TRUE(both.estimate_only);
  EXPECT_FALSE(parse({"--baselines=none"}).wants_baseline("mesh-warp"));
}

}  // namespace
}  // namespace tessera::bench
