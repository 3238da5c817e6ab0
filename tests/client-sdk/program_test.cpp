// tessera-client against a daemon: tickets, TLS, video.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "daemon_fixture.h"
#include "tests/transport/certificate.h"

namespace tessera::client::test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

class Program : public DaemonFixture {
 protected:
  void SetUp() override {
    char pattern[] = "/tmp/tessera-program-XXXXXX";
    folder_ = mkdtemp(pattern);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string file(const std::string& name) const { return (folder_ / name).string(); }
  static std::string text_of(const std::string& file) {
    std::stringstream text;
    text << std::ifstream(file).rdbuf();
    return text.str();
  }
  // The exit code; what it printed is in output_ and errors_.
  int run(const std::string& command) {
    const int status = std::system((command + " >" + file("out") + " 2>" + file("err")).c_str());
    output_ = text_of(file("out"));
    errors_ = text_of(file("err"));
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  std::string viewer(const std::string& arguments, const std::string& host = "127.0.0.1",
                     int width = 64) const {
    return TESSERA_CLIENT " --width " + std::to_string(width) + " --height 48 --seconds 0.2 --control " +
           host + ":" + std::to_string(daemon_->control_port()) + " " + arguments;
  }
  uint64_t sessions() {
    grpc::ClientContext context;
    v1::ListSessionsResponse response;
    EXPECT_TRUE(control_->ListSessions(&context, {}, &response).ok());
    return static_cast<uint64_t>(response.sessions_size());
  }

  std::filesystem::path folder_;
  std::string output_, errors_;
};

TEST_F(Program, PrintsATicketThatItCanViewByItself) {
  start({});
  ASSERT_EQ(run(viewer("--scene hall --print-ticket")), 0) << errors_;
  EXPECT_THAT(output_, StartsWith("tessera://127.0.0.1:" + std::to_string(daemon_->meta_port()) + "/"));
  EXPECT_EQ(sessions(), 1u) << "left to an app";
  EXPECT_THAT(errors_, AllOf(HasSubstr("session 1 ends"), HasSubstr("--idle-timeout")));
  EXPECT_THAT(errors_, HasSubstr("tessera.v1.Control/DeleteSession"));
  EXPECT_THAT(errors_, Not(HasSubstr("tessera://"))) << "a secret";
  const std::string ticket = output_.substr(0, output_.find('\n'));
  ASSERT_EQ(run(viewer("--ticket " + ticket + " --out " + file("pictures"))), 0) << errors_;
  EXPECT_TRUE(std::filesystem::exists(file("pictures/000000.png")));
  EXPECT_EQ(sessions(), 1u) << "who brought the ticket ends the session";

  EXPECT_EQ(run(viewer("--ticket tessera://127.0.0.1:1/12")), 1);
  EXPECT_THAT(errors_, HasSubstr("ticket: "));
  EXPECT_EQ(run(viewer("--ticket " + ticket + " --scene hall")), 2) << "either, not both";
  EXPECT_EQ(run(viewer("")), 2);
}

TEST_F(Program, DrawsTwoEyesSideBySide) {
  start({});
  ASSERT_EQ(run(viewer("--scene hall --stereo --foveation 1 --bias 0 --out " + file("pictures"))), 0)
      << errors_;
  const std::string png = text_of(file("pictures/000000.png"));
  ASSERT_GT(png.size(), 24u);
  const auto number = [&](size_t at) {
    return static_cast<uint8_t>(png[at + 2]) * 256 + static_cast<uint8_t>(png[at + 3]);
  };
  EXPECT_EQ(number(16), 128) << "the width, of two eyes";
  EXPECT_EQ(number(20), 48);
  EXPECT_EQ(run(viewer("--scene hall --foveation 9")), 2);
  EXPECT_EQ(run(viewer("--ticket tessera://127.0.0.1:1/12 --foveation 1")), 2)
      << "whoever made it has decided that";
}

TEST_F(Program, WritesVideo) {
  start({});
  ASSERT_EQ(run(viewer("--scene hall --fps 30 --out " + file("hall.mp4") + " --json " + file("run.json"))), 0)
      << errors_;
  const auto json = nlohmann::json::parse(text_of(file("run.json")), nullptr, false);
  ASSERT_EQ(
      run("ffprobe -v error -count_frames -select_streams v -show_entries stream=width,height,nb_read_frames "
          "-of csv=p=0 " +
          file("hall.mp4")),
      0)
      << errors_;
  EXPECT_EQ(output_, "64,48," + std::to_string(json.value("frames_displayed", 0)) + "\n");
  EXPECT_EQ(json.value("pictures", -1), json.value("frames_displayed", 0));

  EXPECT_EQ(run("PATH=/nonexistent " + viewer("--scene hall --out " + file("none.mp4"))), 1);
  EXPECT_THAT(errors_, HasSubstr("install the package ffmpeg"));
  EXPECT_EQ(run(viewer("--scene hall --out " + file("odd.mp4"), "127.0.0.1", 63)), 1);
  EXPECT_THAT(errors_, HasSubstr("even sides"));
  EXPECT_EQ(run(viewer("--scene hall --out " + file("no/such/folder/hall.mp4"))), 1);
  EXPECT_THAT(errors_, HasSubstr("no/such/folder"));
}

TEST_F(Program, SpeaksTlsToControlAndSession) {
  const transport::test::Certificate certificate("localhost");
  start({.tls_certificate = certificate.certificate_file(), .tls_key = certificate.key_file()});
  const std::string authority = " --ca " + certificate.certificate_file();
  ASSERT_EQ(run(viewer("--scene hall --out " + file("pictures") + authority)), 0) << errors_;
  EXPECT_TRUE(std::filesystem::exists(file("pictures/000000.png")));

  ASSERT_EQ(run(viewer("--scene hall --print-ticket" + authority)), 0) << errors_;
  const std::string ticket = output_.substr(0, output_.find('\n'));
  EXPECT_THAT(ticket, HasSubstr("?ca=" + certificate.certificate_file()));
  EXPECT_EQ(run(viewer("--ticket '" + ticket + "'")), 0) << errors_;
  EXPECT_EQ(run(viewer("--ticket " + ticket.substr(0, ticket.find('?')))), 1) << "in clear text";

  const transport::test::Certificate other("localhost");
  EXPECT_EQ(run(viewer("--scene hall --ca " + other.certificate_file())), 1);
  EXPECT_EQ(run(viewer("--ticket '" + ticket.substr(0, ticket.find('?')) + "?ca=" + other.certificate_file() +
                       "'")),
            1);
  EXPECT_THAT(errors_, HasSubstr("TLS handshake"));
  EXPECT_EQ(run(viewer("--scene hall --ca /no/such.pem")), 1);
  EXPECT_THAT(errors_, HasSubstr("/no/such.pem"));
}

TEST_F(Program, ShowsTheControlTokenFromItsFile) {
  const transport::test::Certificate certificate("localhost");
  const auto token_file = [&](const std::string& name, const std::string& token) {
    std::ofstream(file(name)) << token;
    std::filesystem::permissions(file(name), std::filesystem::perms::owner_read);
    return file(name);
  };
  const std::string right = token_file("right", "0123456789abcdef"),
                    wrong = token_file("wrong", "123456789abcdef0");
  start({.tls_certificate = certificate.certificate_file(),
         .tls_key = certificate.key_file(),
         .control_token_file = right});
  const std::string command = viewer("--scene hall --ca " + certificate.certificate_file());
  const std::string frames = " --frames-csv " + file("frames.csv");  // by a call of its own
  ASSERT_EQ(run(command + frames + " --control-token-file " + right), 0) << errors_;
  EXPECT_GT(std::ranges::count(text_of(file("frames.csv")), '\n'), 1);
  ASSERT_EQ(run("TESSERA_CONTROL_TOKEN_FILE=" + right + " " + command), 0) << errors_;

  EXPECT_EQ(run(command), 1);
  EXPECT_THAT(errors_, AllOf(HasSubstr("control at 127.0.0.1:"), HasSubstr("no control token"),
                             HasSubstr("--control-token-file")));
  EXPECT_EQ(run(command + " --control-token-file " + wrong), 1);
  EXPECT_THAT(errors_, HasSubstr("wrong control token"));
  EXPECT_EQ(run(command + " --control-token-file /no/such/file"), 1);
  EXPECT_THAT(errors_, AllOf(HasSubstr("--control-token-file"), HasSubstr("/no/such/file")));
  std::filesystem::permissions(right, std::filesystem::perms::others_read,
                               std::filesystem::perm_options::add);
  EXPECT_EQ(run(command + " --control-token-file " + right), 1);
  EXPECT_THAT(errors_, HasSubstr("chmod o="));
}

// 0.0.0.0 is this machine too, but does not say so.
TEST_F(Program, KeepsTheControlTokenOutOfClearTextBeyondLoopback) {
  start({});
  std::ofstream(file("token")) << "0123456789abcdef";
  std::filesystem::permissions(file("token"), std::filesystem::perms::owner_read);
  const std::string arguments = "--scene hall --print-ticket --control-token-file " + file("token");
  EXPECT_EQ(run(viewer(arguments)), 0) << errors_;
  EXPECT_EQ(run(viewer(arguments, "0.0.0.0")), 1);
  EXPECT_THAT(errors_, AllOf(HasSubstr("0.0.0.0"), HasSubstr("clear text"), HasSubstr("--ca")));
  EXPECT_EQ(run(viewer(arguments + " --insecure", "0.0.0.0")), 0) << errors_;
}

}  // namespace
}  // namespace tessera::client::test
