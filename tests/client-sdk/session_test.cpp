// A session's life without a server, seen from several threads.
#include "client-sdk/session.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <thread>
#include <vector>

namespace tessera::client {
namespace {

using boost::asio::ip::tcp;
using ::testing::HasSubstr;

constexpr DurationNs kPatienceNs = 60 * kNsPerSecond;  // only a hang takes so long

transport::ClientSettings settings() {
  return {.width = 16, .height = 16, .display_hz = 60};
}

std::vector<SessionEvent> events_until_lost(Session& session) {
  const SteadyClock clock;
  std::vector<SessionEvent> events;
  for (const TimeNs give_up = clock.now() + kPatienceNs; clock.now() < give_up; std::this_thread::yield()) {
    auto event = session.poll_event();
    if (!event) continue;
    events.push_back(*std::move(event));
    if (events.back().state == SessionState::lost) break;
  }
  return events;
}

TEST(Session, SeveralThreadsShareTheEventsOfARefusedConnection) {
  Session session({.host = "127.0.0.1", .meta_port = 1}, settings(), kNsPerSecond);
  std::vector<SessionEvent> events[2];
  std::atomic<bool> lost = false;
  const auto work = [&](int i) {
    const SteadyClock clock;
    for (const TimeNs give_up = clock.now() + kPatienceNs; !lost && clock.now() < give_up;) {
      session.send_pose({clock.now(), {}});
      session.stats();
      auto event = session.poll_event();
      if (!event) continue;
      lost = lost || event->state == SessionState::lost;
      events[i].push_back(*std::move(event));
    }
  };
  std::thread other(work, 1);
  work(0);
  other.join();
  EXPECT_EQ(events[0].size() + events[1].size(), 2u) << "connecting and lost, once each";
  EXPECT_TRUE(lost);
  EXPECT_FALSE(session.poll_event().has_value());
  EXPECT_EQ(session.acquire().pair, nullptr);
  EXPECT_TRUE(absl::IsUnavailable(session.status())) << session.status();
}

// A server that takes the connection and then says nothing.
class Silence {
 public:
  uint16_t port() const { return acceptor_.local_endpoint().port(); }

 private:
  boost::asio::io_context io_;
  tcp::acceptor acceptor_{io_, {boost::asio::ip::address_v4::loopback(), 0}};
};

TEST(Session, AServerThatSaysNothingIsATimeoutAtItsStep) {
  const Silence server;
  Session session({.host = "127.0.0.1", .meta_port = server.port()}, settings(), kNsPerSecond / 2);
  const auto events = events_until_lost(session);
  ASSERT_EQ(events.size(), 2u);
  EXPECT_EQ(events[0].state, SessionState::connecting);
  EXPECT_TRUE(absl::IsDeadlineExceeded(events[1].reason)) << events[1].reason;
  EXPECT_THAT(std::string(events[1].reason.message()), HasSubstr("no answer to hello"));
}

TEST(Session, CanBeDestroyedWhileItConnects) {
  const Silence server;
  Session session({.host = "127.0.0.1", .meta_port = server.port()}, settings(), kNsPerSecond / 2);
  EXPECT_FALSE(session.send_pose({1, {}}));
  EXPECT_FALSE(session.stats().has_value());
}

}  // namespace
}  // namespace tessera::client
