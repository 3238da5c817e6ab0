// Server and clients over real sockets, in one process.
#include "server/stream_server.h"

#include <gtest/gtest.h>

#include <functional>
#include <thread>

#include "client-sdk/connection.h"
#include "scene/procedural.h"

namespace tessera::server {
namespace {

using testing::Test;

constexpr DurationNs kDisplayNs = 5 * kNsPerMs;
constexpr DurationNs kPatienceNs = 60 * kNsPerSecond;  // only a hang takes so long

class StreamServerTest : public Test {
 protected:
  static void SetUpTestSuite() {
    auto device = gpu::Device::create({.select = "cpu", .validation = true});
    ASSERT_TRUE(device.ok()) << device.status();
    auto loaded = scene::load_scene("gallery:0");
    ASSERT_TRUE(loaded.ok()) << loaded.status();
    device_ = *device;
    auto shared = SharedScene::create(*device, *loaded);
    ASSERT_TRUE(shared.ok()) << shared.status();
    scene_ = *shared;
  }
  static void TearDownTestSuite() {
    scene_.reset();
    device_.reset();
  }

  void start(const StreamServerSettings& settings = {}) {
    auto server = StreamServer::create(settings, clock_);
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
  }

  static SessionSettings small() {
    SessionSettings s;
    s.layout = atlas::blocks::settings_for(512, 256);
    s.rate.bitrate_bps = 20e6;
    return s;
  }

  SessionTicket ticket() {
    auto ticket = server_->create_session(scene_, small());
    EXPECT_TRUE(ticket.ok()) << ticket.status();
    return ticket.ok() ? *ticket : SessionTicket{};
  }

  StatusOr<std::unique_ptr<client::Connection>> connect(const SessionTicket& ticket) {
    return client::Connection::connect({.meta_port = ticket.meta_port,
                                        .token = ticket.token,
                                        .client = {.width = 160,
                                                   .height = 90,
                                                   .fov = Fov::symmetric(1.0f, 16.0f / 9.0f),
                                                   .display_hz = 60,
                                                   .name = "test"}},
                                       clock_);
  }

  // A client's display loop until `done`: a pose each time, and what is newest is reported as shown.
  bool display_until(client::Connection& client, const std::function<bool(const client::Pair*)>& done) {
    const TimeNs give_up = clock_.now() + kPatienceNs;
    while (clock_.now() < give_up) {
      TimedPose pose{clock_.now(), {}};
      pose.pose.position = dvec3(0, 1.6, 0);
      client.send_pose(pose);
      const client::Pair* pair = client.take_newest();
      if (pair) client.report_displayed(pair->frame, clock_.now());
      if (done(pair)) return true;
      std::this_thread::sleep_for(std::chrono::nanoseconds(kDisplayNs));
    }
    return false;
  }

  // Shows `count` pairs, each whole and newer than the one before.
  void expect_pairs(client::Connection& client, int count) {
    FrameNumber last = 0;
    int seen = 0;
    EXPECT_TRUE(display_until(client, [&](const client::Pair* pair) {
      if (!pair) return !client.status().ok();
      EXPECT_EQ(pair->state.frame, pair->frame);
      EXPECT_GT(pair->frame, last);
      last = pair->frame;
      return ++seen == count;
    }));
    EXPECT_EQ(seen, count) << client.status();
  }

  SteadyClock clock_;
  std::unique_ptr<StreamServer> server_;
  static std::shared_ptr<gpu::Device> device_;
  static std::shared_ptr<SharedScene> scene_;
};

std::shared_ptr<gpu::Device> StreamServerTest::device_;
std::shared_ptr<SharedScene> StreamServerTest::scene_;

TEST_F(StreamServerTest, TwoClientsSeeNewerAndNewerPairs) {
  start();
  const SessionTicket a = ticket(), b = ticket();
  auto first = connect(a), second = connect(b);
  ASSERT_TRUE(first.ok()) << first.status();
  ASSERT_TRUE(second.ok()) << second.status();
  EXPECT_NE((*first)->welcome().session, (*second)->welcome().session);
  std::thread other([&] { expect_pairs(**second, 5); });
  expect_pairs(**first, 5);
  other.join();
  EXPECT_EQ((*first)->stats().core.decode_errors, 0u);
}

TEST_F(StreamServerTest, TheServerLearnsTheRoundTripFromTheClient) {
  start();
  const SessionTicket a = ticket();
  auto client = connect(a);
  ASSERT_TRUE(client.ok()) << client.status();
  const DurationNs assumed = server_->stats(a.session)->round_trip_ns;
  EXPECT_TRUE(display_until(
      **client, [&](const client::Pair*) { return server_->stats(a.session)->round_trip_ns != assumed; }));
  EXPECT_GT(server_->stats(a.session)->round_trip_ns, 0);
}

TEST_F(StreamServerTest, AWrongTokenIsRefusedAndDisturbsNobody) {
  start();
  const SessionTicket right = ticket();
  auto client = connect(right);
  ASSERT_TRUE(client.ok()) << client.status();
  SessionTicket wrong = right;
  wrong.token[3] ^= 1;
  const auto refused = connect(wrong);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(std::string(refused.status().message()).find("token"), std::string::npos) << refused.status();
  expect_pairs(**client, 2);
}

TEST_F(StreamServerTest, ASessionHasOneClientAtATime) {
  start();
  const SessionTicket shared = ticket();
  auto client = connect(shared);
  ASSERT_TRUE(client.ok()) << client.status();
  const auto second = connect(shared);
  ASSERT_FALSE(second.ok());
  EXPECT_NE(std::string(second.status().message()).find("has a client already"), std::string::npos)
      << second.status();
  expect_pairs(**client, 2);
}

TEST_F(StreamServerTest, AClientMayLeaveAndAnotherTakeItsSession) {
  start();
  const SessionTicket a = ticket(), b = ticket();
  auto stays = connect(b);
  ASSERT_TRUE(stays.ok()) << stays.status();
  for (int round = 0; round < 3; ++round) {
    StatusOr<std::unique_ptr<client::Connection>> client = absl::UnavailableError("not yet");
    // The server may learn of the one that left a moment later.
    EXPECT_TRUE(display_until(**stays, [&](const client::Pair*) {
      client = connect(a);
      return client.ok();
    })) << client.status();
    expect_pairs(**client, 2);
  }
  expect_pairs(**stays, 2);
}

TEST_F(StreamServerTest, AnEndedSessionTellsItsClientWhy) {
  start();
  const SessionTicket a = ticket();
  auto client = connect(a);
  ASSERT_TRUE(client.ok()) << client.status();
  expect_pairs(**client, 1);
  EXPECT_TRUE(server_->end_session(a.session, "maintenance at noon").ok());
  EXPECT_TRUE(display_until(**client, [&](const client::Pair*) { return !(*client)->status().ok(); }));
  EXPECT_NE(std::string((*client)->status().message()).find("maintenance at noon"), std::string::npos)
      << (*client)->status();
  EXPECT_EQ(server_->sessions(), 0u);
  EXPECT_TRUE(absl::IsNotFound(server_->end_session(a.session, "")));
}

// What lies on the device is made and destroyed by the render thread alone.
TEST_F(StreamServerTest, ScenesComeAndGoWhileSessionsRun) {
  start();
  auto client = connect(ticket());
  ASSERT_TRUE(client.ok()) << client.status();
  for (int i = 0; i < 3; ++i) {
    std::shared_ptr<SharedScene> other;
    const Status loaded = server_->run_on_device([&]() -> Status {
      TESSERA_ASSIGN_OR_RETURN(const auto scene, scene::load_scene("city:1000"));
      TESSERA_ASSIGN_OR_RETURN(other, SharedScene::create(device_, scene));
      return absl::OkStatus();
    });
    ASSERT_TRUE(loaded.ok()) << loaded;
    const std::weak_ptr<SharedScene> watched = other;
    const auto session = server_->create_session(std::exchange(other, nullptr), small());
    ASSERT_TRUE(session.ok()) << session.status();
    auto visitor = connect(*session);
    ASSERT_TRUE(visitor.ok()) << visitor.status();
    expect_pairs(**visitor, 2);
    EXPECT_TRUE(server_->end_session(session->session, "").ok());
    // Behind the release, in the same thread.
    EXPECT_TRUE(server_->run_on_device([&] { return absl::OkStatus(); }).ok());
    EXPECT_TRUE(watched.expired());
    expect_pairs(**client, 2);
  }
  EXPECT_TRUE(absl::IsUnknown(server_->run_on_device([] { return absl::UnknownError("as it is"); })));
}

TEST_F(StreamServerTest, SessionsAreLimited) {
  start({.max_sessions = 2});
  ticket();
  const SessionTicket second = ticket();
  const auto third = server_->create_session(scene_, small());
  EXPECT_TRUE(absl::IsResourceExhausted(third.status())) << third.status();
  EXPECT_TRUE(server_->end_session(second.session, "").ok());
  EXPECT_TRUE(server_->create_session(scene_, small()).ok());
}

TEST_F(StreamServerTest, ABusyPortIsNamed) {
  start();
  StreamServerSettings settings;
  settings.meta.port = server_->meta_port();
  const auto second = StreamServer::create(settings, clock_);
  ASSERT_FALSE(second.ok());
  EXPECT_NE(std::string(second.status().message()).find(std::to_string(settings.meta.port)),
            std::string::npos)
      << second.status();
}

TEST_F(StreamServerTest, OtherAddressesThanLoopbackNeedTlsOrAWordOfConsent) {
  StreamServerSettings settings;
  settings.media.address = settings.meta.address = "0.0.0.0";
  const auto refused = StreamServer::create(settings, clock_);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(std::string(refused.status().message()).find("--insecure"), std::string::npos)
      << refused.status();
  settings.insecure = true;
  EXPECT_TRUE(StreamServer::create(settings, clock_).ok());
}

}  // namespace
}  // namespace tessera::server
