// R9, R10: datagrams are lost, late and out of order. The picture goes on by retransmission, and no pair
// mixes two frames.
#include <gmock/gmock.h>

#include <algorithm>

#include "network_relay.h"
#include "streaming_fixture.h"

namespace tessera::server {
namespace {

TEST(FakeRendererTest, AMixOfTwoFramesShows) {
  auto renderer = test::fake_renders({.moving_objects = 3})(test::small_session());
  ASSERT_TRUE(renderer.ok()) << renderer.status();
  auto core = client::ClientCore::create();
  ASSERT_TRUE(core.ok()) << core.status();
  const TimedPose pose{};
  std::vector<client::Pair> pairs;
  for (const FrameNumber number : {FrameNumber{1}, FrameNumber{0x55aa55aa}}) {
    const auto frame = (*renderer)->render({.number = number, .poses = {&pose, 1}});
    ASSERT_TRUE(frame.ok()) << frame.status();
    ASSERT_TRUE((*core)->on_meta(frame->meta).ok());
    ASSERT_TRUE((*core)->on_atlas(frame->atlas.bytes).ok());
    const client::Pair* pair = (*core)->take_newest();
    ASSERT_NE(pair, nullptr);
    EXPECT_EQ(test::frame_in(pair->atlas), number);
    EXPECT_EQ(test::frame_in(pair->state), number);
    pairs.push_back(*pair);
  }
  pairs[1].state.objects[1] = pairs[0].state.objects[1];
  EXPECT_EQ(test::frame_in(pairs[1].state), std::nullopt);
}

class LossyNetworkTest : public test::FakeStreamingTest, public testing::WithParamInterface<double> {};

TEST_P(LossyNetworkTest, RetransmissionKeepsThePictureGoing) {
  start();
  SessionSettings settings = test::small_session();
  settings.rate.frames_per_second = 30;  // a client that is held up for 4 frames asks for a key frame, too
  settings.rate.bitrate_bps = 8e6;
  const SessionTicket mine = ticket({}, settings);
  test::NetworkSettings network;
  network.up = {.delay_ns = 5 * kNsPerMs, .jitter_ns = 30 * kNsPerMs, .loss = GetParam(), .seed = 1};
  network.down = network.up;
  network.down.seed = 2;
  const test::NetworkRelay relay(mine, network, clock_);
  auto through = connection(mine);
  through.server_address = relay.address();
  through.meta_port = relay.meta_port();
  auto client = client::Connection::connect(through, clock_);
  ASSERT_TRUE(client.ok()) << client.status();
  expect_pairs(**client, 150);

  const client::ConnectionStats stats = (*client)->stats();
  uint64_t next = 0;
  const auto records = server_->records(mine.session, 0, next);
  ASSERT_TRUE(records.ok()) << records.status();
  const auto key_frames = std::ranges::count_if(*records, &FrameRecord::key_frame);
  RecordProperty("recovered", static_cast<int>(stats.media.recovered));
  RecordProperty("given_up", static_cast<int>(stats.media.given_up));
  RecordProperty("key_frames", static_cast<int>(key_frames));
  EXPECT_GT(relay.lost(), 10u);
  EXPECT_GT(stats.media.recovered, 10u);
  EXPECT_LT(stats.media.given_up * 50, stats.media.recovered);
  EXPECT_LE(key_frames, 3) << "retransmission comes first";
  RecordProperty("orphans", static_cast<int>(stats.core.orphans));
  EXPECT_LT(stats.core.orphans, 30u) << "a broken chain is mended within a second";
  EXPECT_EQ(stats.core.decode_errors, 0u);
}

INSTANTIATE_TEST_SUITE_P(Loss, LossyNetworkTest, testing::Values(0.02, 0.05), [](const auto& p) {
  return std::to_string(static_cast<int>(p.param * 100)) + "Percent";
});

}  // namespace
}  // namespace tessera::server
