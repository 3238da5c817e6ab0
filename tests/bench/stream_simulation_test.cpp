#include "bench/stream_simulation.h"

#include <gtest/gtest.h>

namespace tessera::bench {
namespace {

// Answers each frame with two packets of fixed size that carry the frame number, and counts what it was
// asked.
class FakeStreamer final : public Streamer {
 public:
  explicit FakeStreamer(size_t atlas_bytes) : atlas_bytes_(atlas_bytes) {}

  std::string name() const override { return "fake"; }
  StatusOr<std::vector<Packet>> serve(const ServeRequest& request) override {
    requests.push_back(request.number);
    key_frames += request.key_frame;
    newest_pose = request.poses.back().time_ns;
    round_trip = request.round_trip_ns;
    for (size_t i = 1; i < request.poses.size(); ++i) {
      EXPECT_LT(request.poses[i - 1].time_ns, request.poses[i].time_ns) << "poses come in order of time";
    }
    return std::vector<Packet>{{Channel::meta, packet(request.number, 100)},
                               {Channel::atlas, packet(request.number, atlas_bytes_)}};
  }
  Status deliver(Channel channel, std::span<const uint8_t> bytes) override {
    const FrameNumber number = bytes[0];
    (channel == Channel::atlas ? atlas_ : meta_) = number;
    return absl::OkStatus();
  }
  std::optional<FrameNumber> newest_frame() override {
    if (!atlas_ || !meta_) return std::nullopt;
    return std::min(*atlas_, *meta_);
  }
  StatusOr<Image8> draw(const View&) override { return Image8(1, 1); }
  bool wants_key_frame() const override { return ask_for_key_frame; }

  std::vector<FrameNumber> requests;
  int key_frames = 0;
  TimeNs newest_pose = 0;
  DurationNs round_trip = 0;
  bool ask_for_key_frame = false;

 private:
  static std::vector<uint8_t> packet(FrameNumber number, size_t size) {
    return std::vector<uint8_t>(size, static_cast<uint8_t>(number));
  }
  size_t atlas_bytes_;
  std::optional<FrameNumber> atlas_, meta_;
};

CameraPath moving_path() {
  std::vector<TimedPose> poses;
  for (int i = 0; i <= 100; ++i) poses.push_back({from_ms(100 * i), Pose{dvec3(i, 0, 0)}});
  return CameraPath(poses);
}

LoopbackSettings settings() {
  LoopbackSettings s;
  s.bitrate_mbps = 20;
  return s;
}

TEST(StreamSimulation, PathStandsStillUntilTheFirstFrameAndThenRuns) {
  FakeStreamer streamer(1000);
  const CameraPath path = moving_path();
  StreamSimulation simulation(streamer, path, settings());
  for (uint32_t i = 0; i < 60; ++i) {
    const auto moment = simulation.next_display();
    ASSERT_TRUE(moment.ok()) << moment.status();
    EXPECT_EQ(moment->index, i);
    EXPECT_NEAR(to_seconds(moment->path_time_ns), i / 60.0, 1e-6);
    EXPECT_NEAR(moment->view.pose.position.x, 10 * i / 60.0, 1e-4);
    EXPECT_EQ(moment->view.width, 960u);
  }
}

TEST(StreamSimulation, TheSamePosesWheneverTheFirstFrameCame) {
  const CameraPath path = moving_path();
  FakeStreamer small(1000), large(200'000);
  StreamSimulation early(small, path, settings()), late(large, path, settings());
  for (int i = 0; i < 60; ++i) {
    const auto a = early.next_display(), b = late.next_display();
    ASSERT_TRUE(a.ok() && b.ok());
    ASSERT_LT(a->now_ns, b->now_ns);
    EXPECT_EQ(a->view.pose.position.x, b->view.pose.position.x) << i;
    EXPECT_EQ(a->path_time_ns, b->path_time_ns) << i;
  }
}

TEST(StreamSimulation, DurationsTileTheEndToEndTime) {
  FakeStreamer streamer(40'000);
  const CameraPath path = moving_path();
  StreamSimulation simulation(streamer, path, settings());
  for (int i = 0; i < 120; ++i) ASSERT_TRUE(simulation.next_display().ok());
  ASSERT_GT(simulation.shown_frames().size(), 20u);
  for (const FrameRecord& t : simulation.shown_frames()) {
    const auto d = durations(t);
    ASSERT_TRUE(d) << "frame " << t.frame;
    EXPECT_EQ(d->pose_uplink, from_ms(50));
    EXPECT_GE(d->server_wait, 0);
    EXPECT_EQ(d->server_render, from_ms(33.3));
    // 40,100 bytes at 20 Mbit/s behind each other, then 50 ms.
    EXPECT_GE(d->downlink, from_ms(50 + 16));
    EXPECT_TRUE(d->atlas_last);
    EXPECT_GE(d->client_wait, 0);
    EXPECT_LE(d->client_wait, from_ms(17));
    EXPECT_EQ(d->sum(), d->end_to_end);
    EXPECT_EQ(d->overhead, 0);
  }
}

TEST(StreamSimulation, ServerUsesTheNewestPoseThatArrived) {
  FakeStreamer streamer(1000);
  const CameraPath path = moving_path();
  StreamSimulation simulation(streamer, path, settings());
  for (int i = 0; i < 30; ++i) ASSERT_TRUE(simulation.next_display().ok());
  const FrameRecord& last = simulation.shown_frames().back();
  EXPECT_LE(durations(last)->server_wait, from_ms(17)) << "poses come 60 times a second";
  EXPECT_NEAR(to_ms(streamer.round_trip), to_ms(durations(last)->end_to_end), 40)
      << "the client's measurement";
}

TEST(StreamSimulation, SkipsServerPeriodsWhileTheNetworkIsBehind) {
  FakeStreamer streamer(400'000);  // 160 ms of the link each
  const CameraPath path = moving_path();
  StreamSimulation simulation(streamer, path, settings());
  for (int i = 0; i < 120; ++i) ASSERT_TRUE(simulation.next_display().ok());
  EXPECT_GT(simulation.frames_skipped(), simulation.frames_rendered());
  for (const FrameRecord& t : simulation.shown_frames()) {
    EXPECT_LE(durations(t)->end_to_end, from_ms(650)) << "latency does not build up";
  }
  EXPECT_LE(simulation.megabits_per_second(Channel::atlas), 20 * 1.2);
}

TEST(StreamSimulation, FrameNumbersHaveNoGapsAndKeyFrameRequestsArrive) {
  FakeStreamer streamer(1000);
  const CameraPath path = moving_path();
  StreamSimulation simulation(streamer, path, settings());
  ASSERT_TRUE(simulation.next_display().ok());
  EXPECT_EQ(streamer.key_frames, 0);
  streamer.ask_for_key_frame = true;
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(simulation.next_display().ok());
  EXPECT_GT(streamer.key_frames, 0);
  for (size_t i = 0; i < streamer.requests.size(); ++i) EXPECT_EQ(streamer.requests[i], i);
}

TEST(StreamSimulation, LossAndJitterOnlyDelay) {
  LoopbackSettings s = settings();
  s.loss = 0.05;
  s.jitter_ms = 20;
  FakeStreamer streamer(20'000);
  const CameraPath path = moving_path();
  StreamSimulation simulation(streamer, path, s);
  FrameNumber newest = 0;
  for (int i = 0; i < 200; ++i) {
    const auto moment = simulation.next_display();
    ASSERT_TRUE(moment.ok());
    newest = std::max(newest, moment->frame);
  }
  EXPECT_GT(newest, 80u);
}

}  // namespace
}  // namespace tessera::bench
