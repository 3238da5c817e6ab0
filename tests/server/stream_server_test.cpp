// Server and clients over real sockets, in one process.
#include "server/stream_server.h"

#include <gtest/gtest.h>

#include <thread>

#include "client-sdk/client_core.h"
#include "client-sdk/display.h"
#include "codec/yuv.h"
#include "scene/procedural.h"
#include "server/session.h"
#include "streaming_fixture.h"
#include "transport/asio/endpoint.h"

namespace tessera::server {
namespace {

using test::kPatienceNs;

// A clock far from the server's.
class OtherClock final : public Clock {
 public:
  TimeNs now() const override { return steady_.now() - kBehindNs; }
  static constexpr DurationNs kBehindNs = 1'234'567'890'123;

 private:
  SteadyClock steady_;
};

// What a frame was made of and what came out, with a session of its own behind.
struct Recorded {
  std::vector<TimedPose> poses;
  FrameInput input;
  Frame frame;
};
class RecordingRenderer final : public FrameRenderer {
 public:
  RecordingRenderer(std::unique_ptr<FrameRenderer> renderer, std::vector<Recorded>& log)
      : renderer_(std::move(renderer)), log_(log) {}
  StatusOr<Frame> render(const FrameInput& input) override {
    TESSERA_ASSIGN_OR_RETURN(Frame frame, renderer_->render(input));
    log_.push_back({{input.poses.begin(), input.poses.end()}, input, frame});
    return frame;
  }
  void set_rate(const RateSplit& rate) override { renderer_->set_rate(rate); }
  const std::string& encoder() const override { return renderer_->encoder(); }

 private:
  std::unique_ptr<FrameRenderer> renderer_;
  std::vector<Recorded>& log_;
};

class StreamServerTest : public test::StreamingTest {
 protected:
  static void SetUpTestSuite() {
    auto device = gpu::Device::create({.select = "cpu", .validation = true});
    ASSERT_TRUE(device.ok()) << device.status();
    auto loaded = scene::load_scene("gallery:0");
    ASSERT_TRUE(loaded.ok()) << loaded.status();
    device_ = *device;
    const uint64_t empty = device_->memory_in_use();
    auto shared = SharedScene::create(*device, *loaded);
    ASSERT_TRUE(shared.ok()) << shared.status();
    scene_ = *shared;
    scene_bytes_ = static_cast<double>(device_->memory_in_use() - empty);
  }
  static void TearDownTestSuite() {
    scene_.reset();
    device_.reset();
  }

  // `log` outlives the server.
  static RendererFactory recording(std::vector<Recorded>& log) {
    return
        [&log, make = renders(scene_)](const SessionSettings& s) -> StatusOr<std::unique_ptr<FrameRenderer>> {
          TESSERA_ASSIGN_OR_RETURN(std::unique_ptr<FrameRenderer> session, make(s));
          return std::make_unique<RecordingRenderer>(std::move(session), log);
        };
  }

  static SessionSettings small() {
    SessionSettings s;
    s.layout = atlas::layout_settings(atlas::LayoutKind::blocks, 512, 256);
    s.rate.bitrate_bps = 20e6;
    return s;
  }

  SessionTicket ticket() { return StreamingTest::ticket(renders(scene_), small()); }

  static std::shared_ptr<gpu::Device> device_;
  static std::shared_ptr<SharedScene> scene_;
  static double scene_bytes_;  // on the device
};

std::shared_ptr<gpu::Device> StreamServerTest::device_;
std::shared_ptr<SharedScene> StreamServerTest::scene_;
double StreamServerTest::scene_bytes_ = 0;

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
  EXPECT_EQ((*first)->stats().core.orphans, 0u);
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

// R6: the stages tile the total, although the two clocks have nothing in common.
TEST_F(StreamServerTest, EveryFramesRecordTilesItsTimeFromPoseToPicture) {
  start();
  const SessionTicket a = ticket();
  const OtherClock clock;
  auto client = client::Connection::connect(connection(a), clock);
  ASSERT_TRUE(client.ok()) << client.status();
  std::vector<FrameRecord> records;
  uint64_t next = 0;
  const TimeNs give_up = clock.now() + kPatienceNs;
  size_t whole = 0;
  while (whole < 10 && clock.now() < give_up) {
    // Where the head will be, as an app for a headset says it; it has not been sent earlier for that.
    (*client)->send_pose({clock.now() + 30 * kNsPerMs, {.position = dvec3(0, 1.6, 0)}});
    if (const client::Pair* pair = (*client)->take_newest())
      (*client)->report_displayed(pair->frame, clock.now());
    const auto more = server_->records(a.session, next, next);
    ASSERT_TRUE(more.ok()) << more.status();
    records.insert(records.end(), more->begin(), more->end());
    whole = static_cast<size_t>(
        std::ranges::count_if(records, [](const auto& r) { return durations(r).has_value(); }));
    std::this_thread::sleep_for(std::chrono::nanoseconds(kDisplayNs));
  }
  ASSERT_GE(whole, 10u);
  EXPECT_EQ(next, records.size());
  for (const FrameRecord& r : records) {
    const auto d = durations(r);
    if (!d) continue;
    EXPECT_EQ(r.session, a.session);
    EXPECT_EQ(r.frame, r.client.frame);
    EXPECT_GT(r.atlas_bytes, 0u);
    EXPECT_LE(std::abs(r.client.clock_offset - OtherClock::kBehindNs), r.client.clock_error);
    EXPECT_LE(std::abs(d->end_to_end - d->sum()), kNsPerMs) << "frame " << r.frame;
    // The offset may be wrong by its error; all else is exact.
    for (const auto& [name, duration] : d->named()) {
      const bool crosses = name == "pose_uplink" || name == "downlink";
      EXPECT_GE(duration, crosses ? -r.client.clock_error : 0) << name << " of frame " << r.frame;
    }
    EXPECT_GE(d->overhead, 0);
    EXPECT_LE(r.client.atlas_first_packet, r.client.atlas_complete);
  }
}

// Apps learn when a picture was shown from their compositor, often a frame later.
TEST_F(StreamServerTest, ADisplayTimeMayComeAfterTheNextPairWasTaken) {
  start();
  const SessionTicket a = ticket();
  auto client = connect(a);
  ASSERT_TRUE(client.ok()) << client.status();
  std::vector<FrameRecord> records;
  uint64_t next = 0;
  std::optional<FrameNumber> before;
  TimeNs shown = 0;
  EXPECT_TRUE(display_without_report(**client, [&](const client::Pair* pair) {
    if (pair) {
      if (before) (*client)->report_displayed(*before, shown);
      before = pair->frame, shown = clock_.now();
    }
    const auto more = server_->records(a.session, next, next);
    if (more.ok()) records.insert(records.end(), more->begin(), more->end());
    return std::ranges::count_if(records, [](const auto& r) { return durations(r).has_value(); }) >= 5;
  }));
  for (const FrameRecord& r : records) {
    const auto d = durations(r);
    if (!d) continue;
    EXPECT_GE(d->client_wait, 0) << "frame " << r.frame;
    EXPECT_GE(d->display, 0) << "frame " << r.frame;
    EXPECT_LE(std::abs(d->end_to_end - d->sum()), kNsPerMs) << "frame " << r.frame;
  }
}

// Poses' times are the client's word: however close they lie, few are kept.
TEST_F(StreamServerTest, AFloodOfPosesIsKeptShort) {
  start();
  std::vector<Recorded> log;  // the render thread's, until the server is gone
  const auto a = server_->create_session(recording(log), small());
  ASSERT_TRUE(a.ok()) << a.status();
  auto client = connect(*a);
  ASSERT_TRUE(client.ok()) << client.status();
  TimeNs t = clock_.now() + kNsPerSecond;  // beyond those of the display loop
  int pairs = 0;
  EXPECT_TRUE(display_without_report(**client, [&](const client::Pair* pair) {
    for (int i = 0; i < 500; ++i) (*client)->send_pose({++t, {.position = dvec3(0, 1.6, 0)}});
    return (pairs += pair != nullptr) == 4;
  }));
  client->reset();
  server_.reset();
  ASSERT_FALSE(log.empty());
  size_t most = 0;
  for (const Recorded& r : log) most = std::max(most, r.poses.size());
  EXPECT_LE(most, 256u);
  EXPECT_GT(most, 100u) << "the flood arrived";
}

TEST_F(StreamServerTest, AHugeViewIsRefusedByItsPixels) {
  start();
  const SessionTicket a = ticket();
  client::ConnectionSettings huge = connection(a);
  huge.client.width = huge.client.height = 16384;
  const auto refused = client::Connection::connect(huge, clock_);
  EXPECT_EQ(refused.status().code(), absl::StatusCode::kResourceExhausted) << refused.status();
  EXPECT_NE(std::string(refused.status().message()).find("16384x16384"), std::string::npos);
  auto client = connect(a);  // the place is still free
  ASSERT_TRUE(client.ok()) << client.status();
  expect_pairs(**client, 1);
}

TEST_F(StreamServerTest, TheRendererLearnsTheClientsEyesAndItsNewestGaze) {
  start();
  std::vector<Recorded> log;  // the render thread's, until the server is gone
  SessionSettings made;       // likewise
  const auto a = server_->create_session(
      [&made, make = recording(log)](const SessionSettings& s) {
        made = s;
        return make(s);
      },
      small());
  ASSERT_TRUE(a.ok()) << a.status();
  client::ConnectionSettings stereo = connection(*a);
  stereo.client.eyes.push_back({.fov = Fov::symmetric(0.8f, 1.0f)});
  stereo.client.eyes[0].in_head.position.x = -0.03125;
  stereo.client.eyes[1].in_head = {{0.03125, 0, 0}, dquat(0.5, 0.5, 0.5, 0.5)};
  auto client = client::Connection::connect(stereo, clock_);
  ASSERT_TRUE(client.ok()) << client.status();
  const vec3 gaze(0.6f, 0, -0.8f);
  FrameNumber pairs = 0;
  for (const TimeNs give_up = clock_.now() + kPatienceNs; pairs < 3 && clock_.now() < give_up;) {
    (*client)->send_pose({clock_.now(), {}}, gaze);
    if ((*client)->take_newest()) ++pairs;
    std::this_thread::sleep_for(std::chrono::nanoseconds(kDisplayNs));
  }
  client->reset();
  server_.reset();
  ASSERT_FALSE(log.empty());
  for (const Recorded& r : log) EXPECT_EQ(r.input.gaze, gaze);
  ASSERT_EQ(made.eyes.size(), 2u);
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(made.eyes[i].in_head, stereo.client.eyes[i].in_head);
    EXPECT_EQ(made.eyes[i].fov.up, stereo.client.eyes[i].fov.up);
  }
  EXPECT_EQ(made.client_view.width, 160u);
}

// The same inputs give the same pictures, whether real sockets and clocks lie between the two ends or
// nothing.
TEST_F(StreamServerTest, PicturesOverSocketsAreThoseOfVirtualTime) {
  start();
  std::vector<Recorded> log;  // the render thread's, until the server is gone
  const auto a = server_->create_session(recording(log), small());
  ASSERT_TRUE(a.ok()) << a.status();
  auto connected = connect(*a);
  ASSERT_TRUE(connected.ok()) << connected.status();
  auto display = client::Display::create({.width = 160, .height = 90});
  ASSERT_TRUE(display.ok()) << display.status();
  View view;
  view.width = 160, view.height = 90;
  view.fov = Fov::symmetric(1.0f, 16.0f / 9.0f);
  const auto draw = [&](const client::Pair& pair, const Pose& pose) {
    view.pose = pose;
    EXPECT_TRUE((*display)->set_state(pair.state).ok());
    EXPECT_TRUE((*display)->set_atlas(codec::view_of(pair.atlas)).ok());
    auto image = (*display)->draw(view);
    EXPECT_TRUE(image.ok()) << image.status();
    return image.ok() ? image->rgba : std::vector<uint8_t>{};
  };

  struct Shown {
    Pose pose;
    std::vector<uint8_t> picture;
  };
  std::map<FrameNumber, Shown> shown;
  for (const TimeNs give_up = clock_.now() + kPatienceNs; shown.size() < 8 && clock_.now() < give_up;) {
    Pose pose{.position = dvec3(0.05 * static_cast<double>(shown.size()), 1.6, 0)};
    pose.orientation = glm::angleAxis(0.1 * static_cast<double>(shown.size()), dvec3(0, 1, 0));
    (*connected)->send_pose({clock_.now(), pose});
    if (const client::Pair* pair = (*connected)->take_newest()) {
      shown[pair->frame] = {pose, draw(*pair, pose)};
      (*connected)->report_displayed(pair->frame, clock_.now());
    }
    std::this_thread::sleep_for(std::chrono::nanoseconds(kDisplayNs));
  }
  ASSERT_EQ(shown.size(), 8u) << (*connected)->status();
  connected->reset();
  server_.reset();  // the device is this thread's now

  SessionSettings settings = small();
  settings.client_view = view;
  auto session = renders(scene_)(settings);
  ASSERT_TRUE(session.ok()) << session.status();
  auto core = client::ClientCore::create();
  ASSERT_TRUE(core.ok()) << core.status();
  size_t compared = 0;
  for (const Recorded& r : log) {
    FrameInput input = r.input;
    input.poses = r.poses;
    const auto frame = (*session)->render(input);
    ASSERT_TRUE(frame.ok()) << frame.status();
    ASSERT_EQ(frame->meta, r.frame.meta) << "frame " << input.number;
    ASSERT_EQ(frame->atlas.bytes, r.frame.atlas.bytes) << "frame " << input.number;
    ASSERT_TRUE((*core)->on_meta(frame->meta).ok());
    ASSERT_TRUE((*core)->on_atlas(frame->atlas.bytes).ok());
    const client::Pair* pair = (*core)->take_newest();
    ASSERT_TRUE(pair && pair->frame == input.number);
    const auto was = shown.find(input.number);
    if (was == shown.end()) continue;
    EXPECT_EQ(draw(*pair, was->second.pose), was->second.picture) << "frame " << input.number;
    ++compared;
  }
  EXPECT_EQ(compared, shown.size());
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
  EXPECT_TRUE(absl::IsFailedPrecondition(second.status())) << second.status();
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
    const auto session = server_->create_session(renders(std::exchange(other, nullptr)), small());
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

// R12: the scene lies on the device once, however many look at it.
TEST_F(StreamServerTest, FourSessionsShareOneSceneAndTheDevice) {
  start();
  const auto memory = [&] {
    uint64_t bytes = 0;
    EXPECT_TRUE(server_
                    ->run_on_device([&] {
                      bytes = device_->memory_in_use();
                      return absl::OkStatus();
                    })
                    .ok());
    return static_cast<double>(bytes);
  };
  const SessionTicket before = ticket();  // what the scene makes only when it is first drawn
  frames_of({before}, 3);
  EXPECT_TRUE(server_->end_session(before.session, "").ok());
  const double none = memory();
  const SessionTicket first = ticket();
  frames_of({first}, 3);
  const double one = memory();
  std::vector<SessionTicket> four{first, ticket(), ticket(), ticket()};
  const std::vector<uint64_t> frames = frames_of(four, 10);
  const double session = one - none;
  EXPECT_GT(session, 0);
  // A session's buffers grow with the latency that it sees; a second copy of the scene would be far larger.
  EXPECT_GT(memory() - one, 2 * session);
  EXPECT_LT(memory() - one, 0.5 * scene_bytes_);
  EXPECT_GT(none, scene_bytes_);
  const auto [least, most] = std::ranges::minmax(frames);
  EXPECT_GE(least, 10u);
  EXPECT_LE(static_cast<double>(most), 1.15 * static_cast<double>(least));
  for (const SessionTicket& ticket : four) EXPECT_TRUE(server_->end_session(ticket.session, "").ok());
  EXPECT_EQ(memory(), none);
}

TEST_F(StreamServerTest, SessionsAreLimited) {
  start({.max_sessions = 2});
  ticket();
  const SessionTicket second = ticket();
  const auto third = server_->create_session(renders(scene_), small());
  EXPECT_TRUE(absl::IsResourceExhausted(third.status())) << third.status();
  EXPECT_TRUE(server_->end_session(second.session, "").ok());
  EXPECT_TRUE(server_->create_session(renders(scene_), small()).ok());
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

class CodecStreaming : public test::FakeStreamingTest, public testing::WithParamInterface<AtlasCodec> {
 protected:
  SessionSettings settings() const {
    SessionSettings s = test::small_session();
    s.codec = GetParam();
    if (s.codec == AtlasCodec::raw) s.rate.bitrate_bps = 40e6;  // 394 kbit a frame
    return s;
  }
};

// The client learns of the codec from the welcome alone.
TEST_P(CodecStreaming, PairsArriveWholeAndAKeyFrameRequestCostsNothing) {
  start();
  const SessionTicket made = ticket({}, settings());
  auto client = connect(made);
  ASSERT_TRUE(client.ok()) << client.status();
  EXPECT_EQ((*client)->welcome().codec, GetParam());
  expect_pairs(**client, 5);
  EXPECT_EQ((*client)->stats().core.decode_errors, 0u);
  EXPECT_EQ((*client)->stats().core.orphans, 0u);
  const StreamedSessionStats stats = *server_->stats(made.session);
  if (GetParam() != AtlasCodec::h264) {
    EXPECT_GE(stats.key_frames, stats.frames_sent);
    EXPECT_GT(stats.frames_sent, 0u);
  }
}

TEST_P(CodecStreaming, PlayersAreSentVideoOnly) {
  start();
  const SessionTicket made = ticket({}, settings());
  auto client = connect(made);
  ASSERT_TRUE(client.ok()) << client.status();
  expect_pairs(**client, 1);
  const auto loopback = *transport::parse_address("127.0.0.1");
  const auto to = transport::peer_address({loopback, 40000});
  const auto forwarding = server_->forward(made.session, to);
  if (GetParam() == AtlasCodec::h264) {
    EXPECT_TRUE(forwarding.ok()) << forwarding.status();
  } else {
    EXPECT_EQ(forwarding.status().code(), absl::StatusCode::kFailedPrecondition);
    EXPECT_NE(std::string(forwarding.status().message()).find(std::string(name_of(GetParam()))),
              std::string::npos);
  }
}

INSTANTIATE_TEST_SUITE_P(All, CodecStreaming,
                         testing::Values(AtlasCodec::h264, AtlasCodec::jpeg, AtlasCodec::raw),
                         [](const auto& info) { return std::string(name_of(info.param)); });

}  // namespace
}  // namespace tessera::server
