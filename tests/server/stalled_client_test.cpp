// R10: the meta channel may stall; the atlas never waits for it, and nobody else notices.
#include "network_relay.h"
#include "streaming_fixture.h"

namespace tessera::server {
namespace {

class StalledClientTest : public test::FakeStreamingTest {
 protected:
  // A client whose meta channel can be held.
  void connect_through_relay(const SessionTicket& ticket) {
    relay_ = std::make_unique<test::NetworkRelay>(ticket, test::NetworkSettings{}, clock_);
    auto through = connection(ticket);
    through.server_address = relay_->address();
    through.meta_port = relay_->meta_port();
    auto client = client::Connection::connect(through, clock_);
    ASSERT_TRUE(client.ok()) << client.status();
    client_ = *std::move(client);
    expect_pairs(*client_, 3);
  }
  void TearDown() override {
    client_.reset();
    relay_.reset();
  }

  std::unique_ptr<test::NetworkRelay> relay_;
  std::unique_ptr<client::Connection> client_;
};

TEST_F(StalledClientTest, TheAtlasGoesOnAndPairsComeBack) {
  start();
  const SessionTicket stalls = ticket({.moving_objects = 20});
  ASSERT_NO_FATAL_FAILURE(connect_through_relay(stalls));
  auto other = connect(ticket());
  ASSERT_TRUE(other.ok()) << other.status();

  relay_->hold_meta(true);
  const uint64_t atlases = client_->stats().core.atlas_frames;
  FrameNumber last_whole = 0;
  EXPECT_TRUE(display_until(*client_, [&](const client::Pair* pair) {
    if (pair) last_whole = pair->frame;
    return client_->stats().core.atlas_frames >= atlases + 60;  // two seconds
  }));
  EXPECT_TRUE(client_->status().ok()) << client_->status();
  EXPECT_LE(client_->stats().core.newest_pair, last_whole + 5) << "it was not held";
  EXPECT_GT(server_->stats(stalls.session)->frames_sent, 60u);
  expect_pairs(**other, 30);

  relay_->hold_meta(false);
  FrameNumber newest = 0;
  EXPECT_TRUE(display_until(*client_, [&](const client::Pair* pair) {
    if (!pair) return !client_->status().ok();
    EXPECT_GT(pair->frame, newest);
    newest = pair->frame;
    return newest > last_whole + 100;
  }));
  EXPECT_GT(newest, last_whole + 100) << client_->status();
  EXPECT_EQ(client_->stats().core.decode_errors, 0u);
  EXPECT_EQ(client_->stats().core.orphans, 0u);
  EXPECT_TRUE((*other)->status().ok()) << (*other)->status();
}

TEST_F(StalledClientTest, AClientThatNeverReadsAgainIsLetGo) {
  StreamServerSettings settings;
  settings.meta.connection.stall_timeout_ns = kNsPerSecond;
  start(settings);
  const SessionTicket stalls = ticket({.moving_objects = 100});
  ASSERT_NO_FATAL_FAILURE(connect_through_relay(stalls));
  auto other = connect(ticket());
  ASSERT_TRUE(other.ok()) << other.status();

  relay_->hold_meta(true);
  const uint64_t sent = server_->stats(stalls.session)->frames_sent;
  EXPECT_TRUE(display_until(*client_,
                            [&](const client::Pair*) { return !server_->stats(stalls.session)->connected; }));
  const StreamedSessionStats stats = *server_->stats(stalls.session);
  EXPECT_TRUE(absl::IsDeadlineExceeded(stats.ended)) << stats.ended;
  // Else the system's buffers, not the client, would have taken them.
  EXPECT_LT(stats.frames_sent - sent, 240u);
  expect_pairs(**other, 10);
  EXPECT_TRUE((*other)->status().ok()) << (*other)->status();

  const auto next = connect(stalls);
  ASSERT_TRUE(next.ok()) << next.status();
  expect_pairs(**next, 3);
}

TEST_F(StalledClientTest, ItsQueueIsBounded) {
  StreamServerSettings settings;
  settings.meta.connection.max_queued_bytes = 100'000;
  start(settings);
  const SessionTicket stalls = ticket({.moving_objects = 300});
  ASSERT_NO_FATAL_FAILURE(connect_through_relay(stalls));
  relay_->hold_meta(true);
  EXPECT_TRUE(display_until(*client_,
                            [&](const client::Pair*) { return !server_->stats(stalls.session)->connected; }));
  const Status ended = server_->stats(stalls.session)->ended;
  EXPECT_EQ(transport::error_code(ended), transport::ErrorCode::too_slow) << ended;
  relay_->hold_meta(false);
  EXPECT_TRUE(display_until(*client_, [&](const client::Pair*) { return !client_->status().ok(); }));
}

}  // namespace
}  // namespace tessera::server
