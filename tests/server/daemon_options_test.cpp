#include "server/daemon_options.h"

#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <fstream>

#include "../transport/child_process.h"

namespace tessera::server {
namespace {

struct Options {
  CLI::App app{"test"};
  DaemonSettings settings;
  LogSettings log;
  Options() {
    app.set_config("--config");
    add_options(app, settings, log);
  }
};

// What the daemon prints as its configuration reads back as the same settings (RELIABILITY R7).
void expect_round_trip(const std::vector<std::string>& flags) {
  Options first;
  std::vector<std::string> reversed(flags.rbegin(), flags.rend());
  ASSERT_NO_THROW(first.app.parse(reversed));
  const transport::test::TemporaryFolder folder;
  const std::string file = folder.file("tesserad.toml");
  std::ofstream(file) << first.app.config_to_str(true, true);
  Options second;
  std::vector<std::string> from_file{file, "--config"};
  ASSERT_NO_THROW(second.app.parse(from_file)) << testing::PrintToString(flags);
  EXPECT_EQ(first.settings, second.settings) << testing::PrintToString(flags);
  EXPECT_EQ(first.log, second.log);
}

const std::vector<std::vector<std::string>> kFlags = {{"--address", "::1"},
                                                      {"--control-port", "0"},
                                                      {"--meta-port", "65535"},
                                                      {"--media-port", "1"},
                                                      {"--http-port", "80"},
                                                      {"--no-http"},
                                                      {"--tls-certificate", "a b.pem"},
                                                      {"--tls-key", "k\"ey.pem"},
                                                      {"--control-token-file", "a 'token'"},
                                                      {"--insecure"},
                                                      {"--max-sessions", "1024"},
                                                      {"--max-atlas-mtexels", "1"},
                                                      {"--max-watchers", "7"},
                                                      {"--idle-timeout", "17"},
                                                      {"--max-scene-mib", "4096"},
                                                      {"--scene", "a=gallery"},
                                                      {"--scene", "a=gallery:1", "--scene", "b=my file.glb"},
                                                      {"--scene-root", "/srv/scenes"},
                                                      {"--device", "1"},
                                                      {"--gather", "raster"},
                                                      {"--log", "debug"},
                                                      {"--log-format", "json"}};

TEST(DaemonOptions, EverySettingReadsBackAsItWasWritten) {
  expect_round_trip({});
  for (const std::vector<std::string>& flags : kFlags) expect_round_trip(flags);
  Options options;
  for (const CLI::Option* option : options.app.get_options()) {
    if (!option->get_configurable() || option->get_name() == "--config") continue;
    EXPECT_TRUE(std::ranges::any_of(kFlags, [&](const auto& f) { return f[0] == option->get_name(); }))
        << option->get_name() << " is not tried";
  }
}

TEST(DaemonOptions, EveryOptionIsAnEnvironmentVariableToo) {
  Options options;
  for (const CLI::Option* option : options.app.get_options()) {
    if (option->get_name() == "--help" || option->get_name() == "--config") continue;
    EXPECT_TRUE(option->get_envname().starts_with("TESSERAD_")) << option->get_name();
    EXPECT_FALSE(option->get_description().empty()) << option->get_name();
  }
}

TEST(DaemonOptions, ValuesOutOfRangeAreRefused) {
  for (const std::vector<std::string>& reversed :
       std::vector<std::vector<std::string>>{{"0", "--max-sessions"},
                                             {"65536", "--meta-port"},
                                             {"-1", "--media-port"},
                                             {"0", "--max-atlas-mtexels"},
                                             {"xml", "--log-format"},
                                             {"loud", "--log"}}) {
    Options options;
    std::vector<std::string> arguments = reversed;
    EXPECT_THROW(options.app.parse(arguments), CLI::ParseError) << testing::PrintToString(reversed);
  }
}

}  // namespace
}  // namespace tessera::server
