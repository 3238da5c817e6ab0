// What lies in deploy/ fits the daemon: it is written once and would drift unseen.
#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>

#include "daemon_fixture.h"
#include "http_client.h"

namespace tessera::server {
namespace {

using testing::HasSubstr;
using transport::test::ChildProcess;
using transport::test::TemporaryFolder;

const std::filesystem::path kDeploy = TESSERA_DEPLOY;

std::string text_of(const std::filesystem::path& file) {
  std::ifstream in(file);
  EXPECT_TRUE(in.good()) << file;
  return {std::istreambuf_iterator<char>(in), {}};
}

class Deploy : public DaemonTest {
 protected:
  // Runs a program to its end; its output is in `log`.
  int run(const std::string& command) {
    ChildProcess child(command, folder_.file("log"));
    EXPECT_TRUE(eventually([&] { return child.exit_code().has_value(); })) << command;
    log_ = text_of(folder_.file("log"));
    return child.exit_code().value_or(-1);
  }
  TemporaryFolder folder_;
  std::string log_;
};

TEST_F(Deploy, TheExampleConfigurationIsWhatTheDaemonPrints) {
  ASSERT_EQ(run(std::string(TESSERAD) + " --print-config"), 0);
  const std::string commented = std::regex_replace(log_, std::regex("(^|\n)([a-z])"), "$1#$2");
  EXPECT_TRUE(text_of(kDeploy / "tesserad.toml").ends_with(commented))
      << "make it anew; its first lines say how. It should end with:\n"
      << commented;
  EXPECT_EQ(run(std::string(TESSERAD) + " --check-config --config " + (kDeploy / "tesserad.toml").string()),
            0);
}

// Every metric in the dashboard exists, labels in legends do too, and rates are taken of counters alone.
TEST_F(Deploy, TheDashboardShowsMetricsThatExist) {
  start({.scenes = {"hall=gallery:0"}});
  v1::Ticket ticket;
  ASSERT_TRUE(create("hall", &ticket).ok());
  EXPECT_FALSE(create("attic", &ticket).ok());  // a refusal, so that there is one
  const std::string metrics = test::body_of(test::get(daemon_->http_port(), "/metrics"));
  std::map<std::string, std::string> types;  // by the names of samples
  const std::regex type_line("# TYPE (\\w+) (\\w+)");
  for (std::sregex_iterator i(metrics.begin(), metrics.end(), type_line), end; i != end; ++i) {
    if ((*i)[2] != "histogram") types[(*i)[1]] = (*i)[2];
    if ((*i)[2] == "histogram")
      for (const char* suffix : {"_bucket", "_sum", "_count"}) types[(*i)[1].str() + suffix] = "counter";
  }
  const auto dashboard = nlohmann::json::parse(text_of(kDeploy / "grafana-dashboard.json"));
  std::set<std::string> used;
  for (const auto& panel : dashboard["panels"]) {
    for (const auto& target : panel["targets"]) {
      const std::string query = target["expr"];
      const std::regex metric("(rate\\()?((tesserad|process)_\\w+)");
      for (std::sregex_iterator i(query.begin(), query.end(), metric), end; i != end; ++i) {
        used.insert((*i)[2]);
        EXPECT_EQ(types[(*i)[2]], (*i)[1].matched ? "counter" : "gauge") << query;
      }
      const std::string legend = target["legendFormat"];
      const std::regex label("\\{\\{(\\w+)\\}\\}");
      for (std::sregex_iterator i(legend.begin(), legend.end(), label), end; i != end; ++i) {
        if ((*i)[1] == "instance") continue;  // Prometheus adds it
        EXPECT_THAT(metrics, HasSubstr((*i)[1].str() + "=\"")) << legend;
      }
    }
  }
  EXPECT_GT(used.size(), 15u);
  EXPECT_THAT(dashboard.dump(), HasSubstr("label_values(tesserad_build_info, instance)"));
  EXPECT_TRUE(types.contains("tesserad_build_info"));
}

TEST_F(Deploy, PortsAreTheDefaults) {
  const DaemonSettings defaults;
  EXPECT_THAT(text_of(kDeploy / "prometheus.yml"), HasSubstr(absl::StrCat("127.0.0.1:", defaults.http_port)));
  EXPECT_THAT(text_of(kDeploy / "Containerfile"),
              HasSubstr(absl::StrCat("EXPOSE ", defaults.control_port, "/tcp ", defaults.meta_port, "/tcp ",
                                     defaults.media_port, "/udp ", defaults.http_port, "/tcp\n")));
}

TEST_F(Deploy, SystemdAcceptsTheUnitAndFindsItTight) {
  if (!transport::test::have_program("systemd-analyze")) GTEST_SKIP() << "systemd-analyze is not installed";
  const std::string unit = folder_.file("tesserad.service");
  transport::test::write_file(unit, std::regex_replace(text_of(kDeploy / "tesserad.service"),
                                                       std::regex("/usr/bin/tesserad"), TESSERAD));
  EXPECT_EQ(run("systemd-analyze verify " + unit), 0) << log_;
  EXPECT_THAT(log_, testing::IsEmpty());
  EXPECT_EQ(run("systemd-analyze security --no-pager --offline=true --threshold=20 " + unit), 0)
      << "exposure above 2.0 of 10\n"
      << log_;
}

}  // namespace
}  // namespace tessera::server
