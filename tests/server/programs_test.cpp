// The programs as processes. R13: a viewer is killed. R14: SIGTERM, and more of them, end tesserad amid its
// work, with exit code 0, and clients are told.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <signal.h>

#include <algorithm>
#include <atomic>
#include <boost/asio/io_context.hpp>
#include <regex>
#include <string>
#include <thread>

#include "client-sdk/connection.h"
#include "client-sdk/ticket.h"
#include "tessera/v1/control.grpc.pb.h"
#include "tests/transport/child_process.h"
#include "transport/asio/asio.h"

namespace tessera::server {
namespace {

using testing::HasSubstr;
using transport::test::ChildProcess;

constexpr DurationNs kPatienceNs = 60 * kNsPerSecond;  // only a hang takes so long

class ProgramsTest : public testing::Test {
 protected:
  void launch(const std::string& scene) {
    daemon_ = std::make_unique<ChildProcess>(
        std::string(TESSERAD) +
            " --device cpu --control-port 0 --meta-port 0 --media-port 0 --http-port 0 --scene " + scene,
        folder_.file("log"));
  }
  bool poll_until(const std::function<bool()>& condition) {
    const TimeNs give_up = clock_.now() + kPatienceNs;
    while (!condition()) {
      if (clock_.now() > give_up) return false;
      std::this_thread::sleep_for(std::chrono::milliseconds(2));  // between two looks at another process
    }
    return true;
  }
  std::string log() {
    const auto bytes = transport::test::read_file(folder_.file("log"));
    return {bytes.begin(), bytes.end()};
  }
  bool serving() {
    const std::string text = log();
    std::smatch found;
    if (!std::regex_search(text, found, std::regex("control_port=(\\d+) meta_port=(\\d+)"))) return false;
    control_port_ = std::stoi(found[1]);
    meta_port_ = static_cast<uint16_t>(std::stoi(found[2]));
    return true;
  }
  void expect_end() {
    const TimeNs begin = clock_.now();
    daemon_->signal(SIGTERM);
    daemon_->signal(SIGTERM);
    ASSERT_TRUE(poll_until([&] {
      const bool over = daemon_->exit_code().has_value();
      if (!over) daemon_->signal(SIGTERM);
      return over;
    })) << log();
    RecordProperty("shutdown_ms", static_cast<int>(to_ms(clock_.now() - begin)));
    EXPECT_EQ(daemon_->exit_code(), 0) << log();
  }
  std::unique_ptr<v1::Control::Stub> control() {
    return v1::Control::NewStub(grpc::CreateChannel("127.0.0.1:" + std::to_string(control_port_),
                                                    grpc::InsecureChannelCredentials()));
  }
  v1::Ticket create_session() {
    grpc::ClientContext context;
    v1::CreateSessionRequest request;
    request.set_scene("hall");
    request.mutable_settings()->set_atlas_width(512);
    request.mutable_settings()->set_atlas_height(256);
    v1::Ticket ticket;
    const grpc::Status created = control()->CreateSession(&context, request, &ticket);
    EXPECT_TRUE(created.ok()) << created.error_message();
    return ticket;
  }
  v1::Session session(const v1::Ticket& ticket) {
    grpc::ClientContext context;
    v1::GetSessionRequest request;
    request.set_session(ticket.session());
    v1::Session found;
    EXPECT_TRUE(control()->GetSession(&context, request, &found).ok());
    return found;
  }
  StatusOr<std::unique_ptr<client::Connection>> connect_client() {
    const v1::Ticket ticket = create_session();
    client::ConnectionSettings settings{.meta_port = meta_port_};
    std::ranges::copy(ticket.token(), settings.token.begin());
    settings.client = {
        .width = 160, .height = 90, .fov = Fov::symmetric(1.0f, 16.0f / 9.0f), .display_hz = 60};
    return client::Connection::connect(settings, clock_);
  }

  const SteadyClock clock_;
  transport::test::TemporaryFolder folder_;
  std::unique_ptr<ChildProcess> daemon_;
  int control_port_ = 0;
  uint16_t meta_port_ = 0;
};

TEST_F(ProgramsTest, AKilledViewerMayComeAgainWithItsTicket) {
  launch("hall=gallery:0");
  ASSERT_TRUE(poll_until([&] { return serving(); })) << log();
  const auto other = connect_client();
  ASSERT_TRUE(other.ok()) << other.status();
  const v1::Ticket ticket = create_session();
  client::Ticket written{.host = "127.0.0.1", .meta_port = meta_port_};
  std::ranges::copy(ticket.token(), written.token.begin());
  const std::string view = std::string(TESSERA_CLIENT) + " --ticket " + client::to_string(written) +
                           " --width 160 --height 90 --seconds ";
  {
    ChildProcess viewer(view + "60", folder_.file("killed"));
    ASSERT_TRUE(poll_until([&] { return session(ticket).frames_sent() >= 5; }));
    viewer.signal(SIGKILL);
    ASSERT_TRUE(poll_until([&] { return !session(ticket).connected(); }));
  }
  ChildProcess again(view + "0.3", folder_.file("again"));
  ASSERT_TRUE(poll_until([&] { return again.exit_code().has_value(); }));
  EXPECT_EQ(again.exit_code(), 0);
  (*other)->send_pose({clock_.now(), {dvec3(0, 1.6, 0), {1, 0, 0, 0}}});
  EXPECT_TRUE(poll_until([&] { return (*other)->take_newest() != nullptr; })) << (*other)->status();
  expect_end();
}

TEST_F(ProgramsTest, DaemonEndsWhileClientsConnect) {
  launch("hall=gallery:0");
  ASSERT_TRUE(poll_until([&] { return serving(); })) << log();
  namespace asio = transport::asio;
  asio::io_context io;
  std::vector<asio::ip::tcp::socket> silent;
  for (int i = 0; i < 5; ++i) {
    silent.emplace_back(io);
    silent.back().connect({asio::ip::address_v4::loopback(), meta_port_});
  }
  expect_end();
}

TEST_F(ProgramsTest, DaemonEndsWhileASceneLoadsOnRequest) {
  launch("hall=gallery:0");
  ASSERT_TRUE(poll_until([&] { return serving(); })) << log();
  std::atomic<bool> calling = false;
  std::thread caller([&] {
    grpc::ClientContext context;
    v1::LoadSceneRequest request;
    request.set_name("city");
    request.set_source("city:4000000");
    v1::Scene scene;
    calling = true;
    (void)control()->LoadScene(&context, request, &scene);
  });
  ASSERT_TRUE(poll_until([&] { return calling.load(); }));
  expect_end();
  caller.join();
}

TEST_F(ProgramsTest, DaemonEndsUnderLoadAndTellsItsClients) {
  launch("hall=gallery:0");
  ASSERT_TRUE(poll_until([&] { return serving(); })) << log();
  std::atomic<int> streaming = 0;
  std::vector<std::thread> clients;
  for (int i = 0; i < 4; ++i) {
    clients.emplace_back([&] {
      const auto client = connect_client();
      ASSERT_TRUE(client.ok()) << client.status();
      bool seen = false;
      EXPECT_TRUE(poll_until([&] {
        (*client)->send_pose({clock_.now(), {dvec3(0, 1.6, 0), {1, 0, 0, 0}}});
        if ((*client)->take_newest() && !std::exchange(seen, true)) ++streaming;
        return !(*client)->status().ok();
      }));
      EXPECT_THAT(std::string((*client)->status().message()), HasSubstr("shutting down"));
    });
  }
  EXPECT_TRUE(poll_until([&] { return streaming == 4; }));
  expect_end();
  for (std::thread& client : clients) client.join();
}

}  // namespace
}  // namespace tessera::server
