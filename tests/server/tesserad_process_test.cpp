// The program: its lines, its signals, its exit codes.
#include <signal.h>

#include <gmock/gmock.h>

#include <atomic>
#include <boost/asio/io_context.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "client-sdk/ticket.h"
#include "daemon_fixture.h"
#include "http_client.h"
#include "transport/asio/asio.h"

namespace tessera::server {
namespace {

using testing::EndsWith;
using testing::HasSubstr;
using transport::test::ChildProcess;

const std::string kFreePorts = " --control-port 0 --meta-port 0 --media-port 0 --http-port 0";

class Process : public DaemonTest {
 protected:
  void run(const std::string& arguments) {
    child_ = std::make_unique<ChildProcess>(TESSERAD + (" " + arguments), folder_.file("log"));
  }
  std::string log() const {
    const auto bytes = transport::test::read_file(folder_.file("log"));
    return {bytes.begin(), bytes.end()};
  }
  bool logged(const std::string& text) {
    return eventually([&] { return log().find(text) != std::string::npos || child_->exit_code(); }) &&
           log().find(text) != std::string::npos;
  }
  std::optional<int> exit_code() {
    EXPECT_TRUE(eventually([&] { return child_->exit_code().has_value(); }));
    return child_->exit_code();
  }
  // A daemon with the scene `hall`, ready for calls.
  void serve(const std::string& arguments = {}) {
    run("--scene hall=gallery:0 " + arguments + kFreePorts);
    ASSERT_TRUE(logged("serving")) << log();
    control_ = connected(grpc::CreateChannel(absl::StrCat("127.0.0.1:", port_in_log("control_port")),
                                             grpc::InsecureChannelCredentials()));
  }
  // Also if the signal comes again and again.
  void expect_end() {
    const TimeNs begin = clock_.now();
    EXPECT_TRUE(eventually([&] {
      const bool over = child_->exit_code().has_value();
      if (!over) child_->signal(SIGTERM);
      return over;
    }));
    RecordProperty("shutdown_ms", static_cast<int>(to_ms(clock_.now() - begin)));
    EXPECT_EQ(exit_code(), 0) << log();
  }
  uint16_t port_in_log(const std::string& key) {
    const std::string text = log();
    const size_t at = text.find(key + "=");
    return at == text.npos ? 0 : static_cast<uint16_t>(std::stoi(text.substr(at + key.size() + 1)));
  }

  transport::test::TemporaryFolder folder_;
  std::unique_ptr<ChildProcess> child_;
};

TEST_F(Process, ASignalEndsItInTime) {
  for (const int signal : {SIGTERM, SIGINT}) {
    run("--scene hall=gallery:0" + kFreePorts);
    ASSERT_TRUE(logged("serving")) << log();
    const TimeNs start_ns = clock_.now();
    child_->signal(signal);
    EXPECT_EQ(exit_code(), 0) << log();
    EXPECT_LT(clock_.now() - start_ns, 5 * kNsPerSecond);
  }
}

// Scenes may load for minutes: that must not hold up a supervisor, and is no failure.
TEST_F(Process, ASignalEndsItWhileScenesLoad) {
  std::string scenes;
  for (int i = 0; i < 50; ++i) scenes += absl::StrCat(" --scene s", i, "=city:200000");
  run("--log info" + scenes + kFreePorts);
  ASSERT_TRUE(logged("rendering")) << log();
  child_->signal(SIGTERM);
  EXPECT_EQ(exit_code(), 0) << log();
  EXPECT_EQ(log().find("serving"), std::string::npos) << "too quick to show anything";
}

TEST_F(Process, ASignalEndsItWhileClientsConnect) {
  ASSERT_NO_FATAL_FAILURE(serve());
  namespace asio = transport::asio;
  asio::io_context io;
  std::vector<asio::ip::tcp::socket> silent;
  for (int i = 0; i < 5; ++i) {
    silent.emplace_back(io);
    silent.back().connect({asio::ip::address_v4::loopback(), port_in_log("meta_port")});
  }
  expect_end();
}

TEST_F(Process, ASignalEndsItWhileASceneLoadsOnRequest) {
  ASSERT_NO_FATAL_FAILURE(serve());
  std::atomic<bool> calling = false;
  std::thread caller([&] {
    calling = true;
    (void)load("city", "city:4000000");
  });
  ASSERT_TRUE(eventually([&] { return calling.load(); }));
  expect_end();
  caller.join();
}

TEST_F(Process, ASignalUnderLoadEndsItAndClientsAreTold) {
  ASSERT_NO_FATAL_FAILURE(serve());
  std::atomic<int> streaming = 0;
  std::vector<std::thread> clients;
  for (int i = 0; i < 4; ++i) {
    clients.emplace_back([&] {
      v1::Ticket ticket;
      ASSERT_TRUE(create("hall", &ticket).ok());
      const auto client = connect(ticket);
      ASSERT_TRUE(client.ok()) << client.status();
      ASSERT_NE(first_pair(**client), nullptr) << (*client)->status();
      ++streaming;
      while (first_pair(**client)) {
      }
      EXPECT_THAT(std::string((*client)->status().message()), HasSubstr("shutting down"));
    });
  }
  EXPECT_TRUE(eventually([&] { return streaming == 4; }));
  expect_end();
  for (std::thread& client : clients) client.join();
}

// R13: whoever reaches the control port must not fill the log.
TEST_F(Process, ARequestThatCannotBeReadLeavesNoLine) {
  ASSERT_NO_FATAL_FAILURE(serve());
  const size_t before = log().size();
  EXPECT_FALSE(load("\xff", "gallery:0").ok());
  EXPECT_EQ(log().size(), before) << log();
}

// R13: nobody says bye, and nobody else notices.
TEST_F(Process, AKilledViewerMayComeAgainWithItsTicket) {
  ASSERT_NO_FATAL_FAILURE(serve());
  v1::Ticket others, ticket;
  ASSERT_TRUE(create("hall", &others).ok());
  const auto other = connect(others);
  ASSERT_TRUE(other.ok()) << other.status();
  ASSERT_TRUE(create("hall", &ticket).ok());
  client::Ticket written{.host = "127.0.0.1", .meta_port = port_in_log("meta_port")};
  std::ranges::copy(ticket.token(), written.token.begin());
  const std::string view = absl::StrCat(TESSERA_CLIENT, " --ticket ", client::to_string(written),
                                        " --width 160 --height 90 --seconds ");
  {
    ChildProcess viewer(view + "60", folder_.file("killed"));
    ASSERT_TRUE(eventually([&] { return get(ticket.session()).frames_sent() >= 5; }));
    viewer.signal(SIGKILL);
    ASSERT_TRUE(eventually([&] { return !get(ticket.session()).connected(); }));
  }
  ChildProcess again(view + "0.3", folder_.file("again"));
  ASSERT_TRUE(eventually([&] { return again.exit_code().has_value(); }));
  EXPECT_EQ(again.exit_code(), 0);
  EXPECT_NE(first_pair(**other), nullptr) << (*other)->status();
}

TEST_F(Process, ItAnswersWhileScenesLoad) {
  start({.scenes = {}});
  const uint16_t port = daemon_->http_port();  // free once this one is gone
  daemon_.reset();
  std::string scenes;
  for (int i = 0; i < 50; ++i) scenes += absl::StrCat(" --scene s", i, "=city:200000");
  run(absl::StrCat(scenes, " --control-port 0 --meta-port 0 --media-port 0 --http-port ", port));
  ASSERT_TRUE(logged("scene loaded")) << log();
  EXPECT_THAT(test::get(port, "/readyz"), HasSubstr("503"));
  EXPECT_THAT(test::get(port, "/healthz"), HasSubstr("200"));
  EXPECT_EQ(log().find("serving"), std::string::npos) << "too quick to show anything";
}

// A newcomer starts the daemon and, at once, a viewer.
TEST_F(Process, AViewerWaitsForADaemonThatLoadsItsScenes) {
  start({.scenes = {}});
  const uint16_t port = daemon_->control_port();  // free once this one is gone
  daemon_.reset();
  ChildProcess viewer(absl::StrCat(TESSERA_CLIENT, " --control 127.0.0.1:", port,
                                   " --scene last --width 64 --height 48 --seconds 0.1"),
                      folder_.file("viewer"));
  std::string scenes;
  for (int i = 0; i < 12; ++i) scenes += absl::StrCat(" --scene s", i, "=city:200000");
  run(absl::StrCat(
      scenes, " --scene last=gallery:0 --meta-port 0 --media-port 0 --http-port 0 --control-port ", port));
  ASSERT_TRUE(logged("serving ")) << log();
  ASSERT_TRUE(eventually([&] { return viewer.exit_code().has_value(); }));
  const auto said = transport::test::read_file(folder_.file("viewer"));
  EXPECT_EQ(viewer.exit_code(), 0) << std::string(said.begin(), said.end());
}

// One line, and none of gRPC's own.
TEST_F(Process, ABusyPortIsOneLineThatSaysWhatToDo) {
  start({.scenes = {}});
  run(absl::StrCat("--log error --meta-port 0 --media-port 0 --http-port 0 --control-port ",
                   daemon_->control_port()));
  EXPECT_EQ(exit_code(), 1);
  const std::string text = log();
  EXPECT_EQ(std::ranges::count(text, '\n'), 1) << text;
  EXPECT_THAT(text, AllOf(HasSubstr("tesserad: cannot open gRPC"), HasSubstr("stop the other program"),
                          HasSubstr(std::to_string(daemon_->control_port()))));
}

TEST_F(Process, JsonLogsAreJsonFromTheFirstLineToTheLast) {
  run("--log debug --log-format json --scene hall=gallery:0" + kFreePorts);
  ASSERT_TRUE(logged("\"serving\"")) << log();
  child_->signal(SIGTERM);
  EXPECT_EQ(exit_code(), 0);
  std::istringstream in(log());
  int lines = 0;
  bool serving = false;
  for (std::string line; std::getline(in, line); ++lines) {
    const auto json = nlohmann::json::parse(line, nullptr, false);
    ASSERT_TRUE(json.is_object()) << line;
    EXPECT_TRUE(json.contains("time") && json.contains("level") && json.contains("event")) << line;
    if (json["event"] == "serving") serving = json["control_port"].is_number();
  }
  EXPECT_GE(lines, 4);
  EXPECT_TRUE(serving);
}

// Neither at the most talkative level, nor of clients that are refused.
TEST_F(Process, TokensAreNotLogged) {
  const std::string control_token = "controls-0123456789";
  const std::string token_file = folder_.file("token");
  transport::test::write_file(token_file, control_token);
  std::filesystem::permissions(token_file, std::filesystem::perms::owner_read);
  ASSERT_NO_FATAL_FAILURE(serve("--log trace --control-token-file " + token_file));
  const std::string where = absl::StrCat("127.0.0.1:", port_in_log("control_port"));
  const auto show = [&](const std::string& token) {
    control_ = v1::Control::NewStub(control_channel(where, grpc::InsecureChannelCredentials(), token));
  };
  v1::Ticket ticket;
  show(control_token + "x");
  expect_refused(create("hall", &ticket), grpc::StatusCode::UNAUTHENTICATED, "wrong control token");
  show(control_token);
  ASSERT_TRUE(create("hall", &ticket).ok());
  const std::string right = ticket.token();
  auto client = connect(ticket);
  ASSERT_TRUE(client.ok()) << client.status();
  ticket.mutable_token()->back() ^= 1;
  EXPECT_FALSE(connect(ticket).ok());
  ASSERT_TRUE(logged("clients refused")) << log();
  child_->signal(SIGTERM);
  EXPECT_EQ(exit_code(), 0);
  std::string text = log();
  EXPECT_THAT(text, AllOf(HasSubstr("client connected"), HasSubstr("control calls refused")));
  EXPECT_EQ(text.find("controls-"), text.npos);
  const std::string start = right.substr(0, 8);  // of both tokens
  EXPECT_EQ(text.find(start), text.npos);
  EXPECT_EQ(text.find(absl::Base64Escape(right).substr(0, 8)), text.npos);
  absl::AsciiStrToLower(&text);
  EXPECT_EQ(text.find(absl::BytesToHexString(start)), text.npos);
}

TEST_F(Process, WrongUsageIsTwo) {
  run("--no-such-option");
  EXPECT_EQ(exit_code(), 2);
  run("--max-sessions 0");
  EXPECT_EQ(exit_code(), 2);
  for (const char* wrong : {"--address 0.0.0.0", "--address localhost", "--scene hall", "--tls-key key.pem",
                            "--control-token-file /no/such/file"}) {
    run(wrong + kFreePorts);
    EXPECT_EQ(exit_code(), 2) << wrong;
    run(std::string("--check-config ") + wrong);
    EXPECT_EQ(exit_code(), 2) << wrong;
    EXPECT_EQ(std::ranges::count(log(), '\n'), 1) << log();
  }
  run("--version");
  EXPECT_EQ(exit_code(), 0);
  EXPECT_THAT(log(), HasSubstr(version()));
}

}  // namespace
}  // namespace tessera::server
