// A StreamServer and clients of it, in one process, over real sockets.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <thread>
#include <vector>

#include "client-sdk/connection.h"
#include "fake_renderer.h"
#include "server/stream_server.h"

namespace tessera::server::test {

constexpr DurationNs kPatienceNs = 60 * kNsPerSecond;  // only a hang takes so long

class StreamingTest : public testing::Test {
 protected:
  static constexpr DurationNs kDisplayNs = 5 * kNsPerMs;

  void start(const StreamServerSettings& settings = {}) {
    auto server = StreamServer::create(settings, clock_);
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
  }

  SessionTicket ticket(RendererFactory renderer, const SessionSettings& settings) {
    auto ticket = server_->create_session(std::move(renderer), settings);
    EXPECT_TRUE(ticket.ok()) << ticket.status();
    return ticket.ok() ? *ticket : SessionTicket{};
  }

  static client::ConnectionSettings connection(const SessionTicket& ticket) {
    return {.meta_port = ticket.meta_port,
            .token = ticket.token,
            .client = {.width = 160,
                       .height = 90,
                       .eyes = {{.fov = Fov::symmetric(1.0f, 16.0f / 9.0f)}},
                       .display_hz = 60,
                       .name = "test"}};
  }
  StatusOr<std::unique_ptr<client::Connection>> connect(const SessionTicket& ticket) {
    return client::Connection::connect(connection(ticket), clock_);
  }

  // What must be right of every pair that is shown.
  virtual void check(const client::Pair& pair) { EXPECT_EQ(pair.state.frame, pair.frame); }

  // A client's display loop until `done`: a pose each time, and what is newest is reported as shown.
  bool display_until(client::Connection& client, const std::function<bool(const client::Pair*)>& done) {
    return display_without_report(client, [&](const client::Pair* pair) {
      if (pair) client.report_displayed(pair->frame, clock_.now());
      return done(pair);
    });
  }
  bool display_without_report(client::Connection& client,
                              const std::function<bool(const client::Pair*)>& done) {
    const TimeNs give_up = clock_.now() + kPatienceNs;
    while (clock_.now() < give_up) {
      TimedPose pose{clock_.now(), {}};
      pose.pose.position = dvec3(0, 1.6, 0);
      client.send_pose(pose);
      const client::Pair* pair = client.take_newest();
      if (pair) check(*pair);
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
      EXPECT_GT(pair->frame, last);
      last = pair->frame;
      return ++seen == count;
    }));
    EXPECT_EQ(seen, count) << client.status();
  }

  // Frames sent to each session, once all have streamed and then the slowest has got `count` more.
  std::vector<uint64_t> frames_of(const std::vector<SessionTicket>& tickets, uint64_t count) {
    std::vector<std::unique_ptr<client::Connection>> clients;
    for (const SessionTicket& ticket : tickets) {
      auto client = connect(ticket);
      EXPECT_TRUE(client.ok()) << client.status();
      if (!client.ok()) return {};
      clients.push_back(*std::move(client));
    }
    std::vector<uint64_t> begin;
    std::vector<uint64_t> frames(tickets.size());
    const TimeNs give_up = clock_.now() + kPatienceNs;
    while (clock_.now() < give_up && *std::ranges::min_element(frames) < count) {
      std::vector<uint64_t> sent;
      for (size_t i = 0; i < clients.size(); ++i) {
        clients[i]->send_pose({clock_.now(), {}});
        if (const client::Pair* pair = clients[i]->take_newest()) check(*pair);
        sent.push_back(server_->stats(tickets[i].session)->frames_sent);
      }
      if (begin.empty() && *std::ranges::min_element(sent) > 0) begin = sent;
      for (size_t i = 0; i < begin.size(); ++i) frames[i] = sent[i] - begin[i];
      std::this_thread::sleep_for(std::chrono::nanoseconds(kDisplayNs));
    }
    return frames;
  }

  SteadyClock clock_;
  std::unique_ptr<StreamServer> server_;
};

// Without a device: of every pair, pixels and scene state must be those of one frame.
class FakeStreamingTest : public StreamingTest {
 protected:
  SessionTicket ticket(const FakeRendererSettings& fake = {},
                       const SessionSettings& settings = small_session()) {
    return StreamingTest::ticket(fake_renders(fake), settings);
  }
  void check(const client::Pair& pair) override {
    EXPECT_EQ(pair.state.frame, pair.frame);
    EXPECT_EQ(frame_in(pair.atlas), pair.frame);
    EXPECT_EQ(frame_in(pair.state), pair.frame);
  }
};

}  // namespace tessera::server::test
