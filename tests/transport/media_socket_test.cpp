// The media port and its clients over real sockets on loopback.
#include <gmock/gmock.h>

#include <atomic>
#include <future>
#include <random>
#include <thread>

#include "asio_fixture.h"
#include "test_streams.h"
#include "transport/asio/endpoint.h"
#include "transport/asio/media_client.h"
#include "transport/asio/media_port.h"

namespace tessera::transport {
namespace {

using test::Bytes;
using ::testing::HasSubstr;

SessionToken token(uint8_t v) {
  SessionToken t;
  t.fill(v);
  return t;
}

class MediaSockets : public test::AsioTest {
 protected:
  void SetUp() override {
    auto opened = MediaPort::open(io.get_executor(), {}, clock);
    ASSERT_TRUE(opened.ok()) << opened.status();
    port = *opened;
  }
  void TearDown() override {
    for (const auto& client : clients) client->close();
    port->close();
    io.restart();
    io.run_for(std::chrono::milliseconds(1));
  }

  // The stream's names, as the welcome would carry them.
  StreamIds add_session(SessionId id, MediaSessionEvents events = {}) {
    RtpSenderSettings settings{.seed = id + 1};
    settings.pacer.rate_bps = 400e6;
    auto sender = *RtpSender::create(settings);
    const StreamIds ids = sender->ids();
    EXPECT_TRUE(
        port->add_session(id, token(static_cast<uint8_t>(id)), std::move(sender), std::move(events)).ok());
    return ids;
  }
  MediaClientSettings settings_of(SessionId id, const StreamIds& ids) {
    MediaClientSettings s;
    s.server_port = port->port();
    s.token = token(static_cast<uint8_t>(id));
    s.receiver.ssrc = ids.ssrc;
    s.receiver.rtx_ssrc = ids.rtx_ssrc;
    s.receiver.first_sequence = ids.first_sequence;
    return s;
  }
  std::shared_ptr<MediaClient> connect(const MediaClientSettings& settings, MediaClientEvents events) {
    auto client = MediaClient::open(io.get_executor(), settings, clock, std::move(events));
    EXPECT_TRUE(client.ok()) << client.status();
    clients.push_back(*client);
    return *client;
  }

  SteadyClock clock;
  std::shared_ptr<MediaPort> port;
  std::vector<std::shared_ptr<MediaClient>> clients;
};

TEST_F(MediaSockets, ABusyPortSaysWhatWhereAndWhatToDo) {
  const Status status = MediaPort::open(io.get_executor(), {.port = port->port()}, clock).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kAlreadyExists);
  EXPECT_THAT(std::string(status.message()), HasSubstr(absl::StrCat("UDP 127.0.0.1:", port->port())));
  EXPECT_THAT(std::string(status.message()), HasSubstr("choose another port"));
  EXPECT_EQ(MediaPort::open(io.get_executor(), {.address = "localhost"}, clock).status().code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(
      std::string(MediaPort::open(io.get_executor(), {.address = "203.0.113.1"}, clock).status().message()),
      HasSubstr("no such address"));
}

TEST_F(MediaSockets, FramesPosesRequestsAndByesCross) {
  std::vector<SequencedPose> poses;
  bool bound = false, left = false;
  int requests = 0;
  const StreamIds ids = add_session(1, {.on_bound = [&] { bound = true; },
                                        .on_pose = [&](const SequencedPose& p) { poses.push_back(p); },
                                        .on_key_frame_request = [&] { ++requests; },
                                        .on_left = [&] { left = true; }});
  EXPECT_EQ(port->send_frame(1, 0, Bytes{0, 0, 1, 0x67, 1}, true).status().code(),
            absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(port->send_frame(2, 0, Bytes{0, 0, 1, 0x67, 1}, true).status().code(),
            absl::StatusCode::kNotFound);

  std::vector<ReceivedFrame> frames;
  const auto client =
      connect(settings_of(1, ids), {.on_frame = [&](ReceivedFrame f) { frames.push_back(std::move(f)); }});
  ASSERT_TRUE(run_until([&] { return bound && client->round_trip_ns(); }));

  std::mt19937_64 random(1);
  std::vector<Bytes> units;
  for (int i = 0; i < 50; ++i) {
    units.push_back(test::make_access_unit(i == 0, 20'000 + random() % 20'000, random));
    ASSERT_TRUE(port->send_frame(1, clock.now(), units.back(), i == 0).ok());
    ASSERT_TRUE(run_until([&] { return frames.size() == units.size(); })) << i;
    ASSERT_TRUE(frames.back().complete);
    ASSERT_EQ(frames.back().access_unit, units.back());
  }

  for (uint32_t i = 0; i < 20; ++i) client->send_pose({i, {i * kNsPerMs, {}}});
  client->send_pose({5, {}});  // old
  client->send_pose({100, {7, {dvec3(1, 2, 3), {1, 0, 0, 0}}}});
  ASSERT_TRUE(run_until([&] { return !poses.empty() && poses.back().sequence == 100; }));
  for (size_t i = 1; i < poses.size(); ++i) EXPECT_GT(poses[i].sequence, poses[i - 1].sequence);
  EXPECT_EQ(poses.back().timed.pose.position, dvec3(1, 2, 3));

  client->request_key_frame();
  ASSERT_TRUE(run_until([&] { return requests > 0; }));
  client->close();
  ASSERT_TRUE(run_until([&] { return left; }));
  EXPECT_EQ(port->sender_stats(1)->frames, 50u);
  EXPECT_EQ(port->dropped_datagrams(), 0u);
}

TEST_F(MediaSockets, OnePortServesManySessionsApart) {
  constexpr int kSessions = 8, kFrames = 20;
  std::vector<std::vector<Bytes>> sent(kSessions), received(kSessions);
  int bound = 0;
  std::mt19937_64 random(2);
  for (int i = 0; i < kSessions; ++i) {
    const auto id = static_cast<SessionId>(i);
    const StreamIds ids = add_session(id, {.on_bound = [&] { ++bound; }});
    connect(settings_of(id, ids),
            {.on_frame = [&, i](ReceivedFrame f) { received[i].push_back(f.access_unit); }});
  }
  ASSERT_TRUE(run_until([&] { return bound == kSessions; }));
  for (int f = 0; f < kFrames; ++f) {
    for (int i = 0; i < kSessions; ++i) {
      sent[i].push_back(test::make_access_unit(f == 0, 5000, random));
      ASSERT_TRUE(port->send_frame(static_cast<SessionId>(i), clock.now(), sent[i].back(), f == 0).ok());
    }
  }
  ASSERT_TRUE(run_until(
      [&] { return std::ranges::all_of(received, [&](const auto& r) { return r.size() == kFrames; }); }));
  EXPECT_EQ(received, sent);
}

TEST_F(MediaSockets, AWrongTokenFailsWithAReason) {
  const StreamIds ids = add_session(1);
  MediaClientSettings settings = settings_of(1, ids);
  settings.token = token(99);
  settings.bind_timeout_ns = 300 * kNsPerMs;
  settings.hello_interval_ns = 50 * kNsPerMs;
  Status failure;
  connect(settings, {.on_failed = [&](Status s) { failure = std::move(s); }});
  ASSERT_TRUE(run_until([&] { return !failure.ok(); }));
  EXPECT_EQ(failure.code(), absl::StatusCode::kDeadlineExceeded);
  EXPECT_THAT(std::string(failure.message()), HasSubstr(absl::StrCat("127.0.0.1:", port->port())));
  EXPECT_THAT(std::string(failure.message()), HasSubstr("token"));
  EXPECT_GE(port->binding_stats().bad_token, 1u);
}

TEST_F(MediaSockets, StrangersAreDroppedAndCounted) {
  add_session(1);
  auto stranger = UdpSocket::open(asio::make_strand(io.get_executor()), {},
                                  [](const auto&, auto) { FAIL() << "an answer"; });
  ASSERT_TRUE(stranger.ok());
  (*stranger)->start();
  const PeerAddress to = peer_address({asio::ip::make_address("127.0.0.1"), port->port()});
  for (const Bytes& datagram :
       {test::from_hex("80c90001 00000002"), test::from_hex("0102"), Bytes(1), Bytes(60'000, 6)})
    ASSERT_TRUE((*stranger)->send(to, datagram));
  ASSERT_TRUE(run_until(
      [&] { return port->binding_stats().unknown_address + port->binding_stats().malformed == 4; }));
  EXPECT_EQ(port->binding_stats().unknown_address, 2u);
  (*stranger)->close();
}

// A client that comes back from another address (NAT) goes on.
TEST_F(MediaSockets, ANewAddressTakesOver) {
  int bound = 0;
  std::vector<ReceivedFrame> first_frames, second_frames;
  const StreamIds ids = add_session(1, {.on_bound = [&] { ++bound; }});
  const auto first = connect(settings_of(1, ids),
                             {.on_frame = [&](ReceivedFrame f) { first_frames.push_back(std::move(f)); }});
  ASSERT_TRUE(run_until([&] { return bound == 1; }));
  connect(settings_of(1, ids), {.on_frame = [&](ReceivedFrame f) { second_frames.push_back(std::move(f)); }});
  ASSERT_TRUE(run_until([&] { return bound == 2; }));
  std::mt19937_64 random(3);
  ASSERT_TRUE(port->send_frame(1, clock.now(), test::make_access_unit(true, 3000, random), true).ok());
  ASSERT_TRUE(run_until([&] { return second_frames.size() == 1; }));
  EXPECT_TRUE(first_frames.empty());
  EXPECT_EQ(port->binding_stats().rebound, 1u);
}

TEST_F(MediaSockets, PosesOfTheNextClientCountFromTheStart) {
  std::vector<uint32_t> poses;
  const StreamIds ids =
      add_session(1, {.on_pose = [&](const SequencedPose& p) { poses.push_back(p.sequence); }});
  for (const uint32_t sequence : {1000u, 0u}) {
    const auto client = connect(settings_of(1, ids), {});
    ASSERT_TRUE(run_until([&] { return client->send_pose({sequence, {}}); }));
    ASSERT_TRUE(run_until([&] { return !poses.empty() && poses.back() == sequence; })) << sequence;
    client->close();
  }
}

TEST_F(MediaSockets, SrtpCarriesMediaAndFeedback) {
  SrtpKeys keys, wrong;
  keys.server.fill(1);
  keys.client.fill(2);
  wrong.server.fill(3);
  int bound = 0, requests = 0, poses = 0;
  auto sender = *RtpSender::create({.seed = 1});
  const StreamIds ids = sender->ids();
  MediaSessionEvents events{.on_bound = [&] { ++bound; },
                            .on_pose = [&](const SequencedPose&) { ++poses; },
                            .on_key_frame_request = [&] { ++requests; }};
  ASSERT_TRUE(port->add_session(1, token(1), std::move(sender), std::move(events), keys).ok());
  std::vector<ReceivedFrame> frames;
  MediaClientSettings settings = settings_of(1, ids);
  std::mt19937_64 random(4);

  // Without the keys nothing is understood.
  settings.srtp = wrong;
  const auto stranger =
      connect(settings, {.on_frame = [&](ReceivedFrame f) { frames.push_back(std::move(f)); }});
  ASSERT_TRUE(run_until([&] { return bound == 1; }));
  ASSERT_TRUE(port->send_frame(1, clock.now(), test::make_access_unit(true, 3000, random), true).ok());
  ASSERT_TRUE(run_until([&] { return port->sender_stats(1)->packets >= 5; }));
  stranger->close();
  EXPECT_TRUE(frames.empty());
  EXPECT_EQ(stranger->stats().packets, 0u);

  settings.srtp = keys;
  settings.receiver.first_sequence.reset();
  const auto client =
      connect(settings, {.on_frame = [&](ReceivedFrame f) { frames.push_back(std::move(f)); }});
  ASSERT_TRUE(run_until([&] { return bound == 2 && client->round_trip_ns(); }));
  EXPECT_FALSE(client->send_pose({}));
  const Bytes unit = test::make_access_unit(true, 30'000, random);
  ASSERT_TRUE(port->send_frame(1, clock.now(), unit, true).ok());
  ASSERT_TRUE(run_until([&] { return frames.size() == 1; }));
  EXPECT_TRUE(frames[0].complete);
  EXPECT_EQ(frames[0].access_unit, unit);
  client->request_key_frame();
  ASSERT_TRUE(run_until([&] { return requests > 0; }));
  EXPECT_EQ(poses, 0);
}

// The same from several threads at once, for the thread sanitizer.
TEST_F(MediaSockets, ManyThreads) {
  constexpr int kSessions = 3, kFrames = 30;
  std::array<std::atomic<int>, kSessions> received{};
  std::array<std::promise<void>, kSessions> bound, all;
  for (int i = 0; i < kSessions; ++i) {
    const StreamIds ids =
        add_session(static_cast<SessionId>(i), {.on_bound = [&, i] { bound[i].set_value(); }});
    connect(settings_of(static_cast<SessionId>(i), ids), {.on_frame = [&, i](const ReceivedFrame&) {
              if (++received[i] == kFrames) all[i].set_value();
            }});
  }
  std::vector<std::thread> threads;
  for (int t = 0; t < 3; ++t) threads.emplace_back([&] { io.run(); });
  constexpr auto kLong = std::chrono::seconds(60);
  for (int i = 0; i < kSessions; ++i) {
    EXPECT_EQ(bound[i].get_future().wait_for(kLong), std::future_status::ready);
  }
  std::vector<std::thread> renderers;
  for (int i = 0; i < kSessions; ++i) {
    renderers.emplace_back([&, i] {
      std::mt19937_64 random(static_cast<uint64_t>(i));
      for (int f = 0; f < kFrames; ++f) {
        EXPECT_TRUE(port->send_frame(static_cast<SessionId>(i), clock.now(),
                                     test::make_access_unit(f == 0, 4000, random), f == 0)
                        .ok());
        EXPECT_TRUE(port->frame_budget_bits(static_cast<SessionId>(i), kNsPerSecond, false).ok());
        clients[i]->send_pose({static_cast<uint32_t>(f), {}});
      }
    });
  }
  for (std::thread& t : renderers) t.join();
  for (int i = 0; i < kSessions; ++i)
    EXPECT_EQ(all[i].get_future().wait_for(kLong), std::future_status::ready);
  for (const auto& client : clients) client->close();
  port->close();
  for (std::thread& t : threads) t.join();
}

}  // namespace
}  // namespace tessera::transport
