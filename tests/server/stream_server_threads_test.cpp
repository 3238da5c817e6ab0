// Everything at once, for ThreadSanitizer: clients that come and go while sessions begin and end and
// strangers knock.
#include <array>
#include <atomic>
#include <boost/asio/io_context.hpp>
#include <random>
#include <vector>

#include "streaming_fixture.h"
#include "transport/asio/asio.h"
#include "transport/datagram.h"

namespace tessera::server {
namespace {

namespace asio = transport::asio;

class StreamServerThreadsTest : public test::FakeStreamingTest {
 protected:
  // Until the server has noticed that the client before has left.
  std::unique_ptr<client::Connection> connect_again(const SessionTicket& ticket) {
    const TimeNs give_up = clock_.now() + test::kPatienceNs;
    auto client = connect(ticket);
    while (absl::IsFailedPrecondition(client.status()) && clock_.now() < give_up) client = connect(ticket);
    EXPECT_TRUE(client.ok()) << client.status();
    return client.ok() ? *std::move(client) : nullptr;
  }
};

TEST_F(StreamServerThreadsTest, ClientsComeAndGo) {
  start();
  std::atomic<bool> done = false;
  std::thread watcher([&] {
    while (!done) {
      uint64_t next = 0;
      for (transport::SessionId id = 1; id < 20; ++id) {
        (void)server_->stats(id);
        (void)server_->records(id, next, next);
      }
      EXPECT_TRUE(server_->run_on_device([] { return absl::OkStatus(); }).ok());
    }
  });
  std::vector<std::thread> clients;
  for (int i = 0; i < 4; ++i) {
    clients.emplace_back([&] {
      for (int round = 0; round < 2; ++round) {
        const SessionTicket mine = ticket();
        for (int visit = 0; visit < 2; ++visit) {
          const auto client = connect_again(mine);
          if (client) expect_pairs(*client, 3);
        }
        EXPECT_TRUE(server_->end_session(mine.session, "").ok());
      }
    });
  }
  for (std::thread& client : clients) client.join();
  done = true;
  watcher.join();
  EXPECT_EQ(server_->sessions(), 0u);
}

// Nothing of the stream before is left: neither keys and numbers nor what waited in queues.
TEST_F(StreamServerThreadsTest, EveryClientHasAStreamOfItsOwn) {
  start();
  const SessionTicket mine = ticket();
  transport::StreamIds before{};
  for (int visit = 0; visit < 5; ++visit) {
    const auto client = connect_again(mine);
    ASSERT_TRUE(client);
    EXPECT_NE(client->welcome().stream, before);
    before = client->welcome().stream;
    expect_pairs(*client, 2);
    EXPECT_EQ(client->stats().core.decode_errors, 0u);
    EXPECT_EQ(client->stats().core.orphans, 0u);
  }
}

// A place that nobody takes is free again; one whose client stays is kept.
TEST_F(StreamServerThreadsTest, ASessionWithoutAClientEnds) {
  start({.idle_timeout_ns = 2 * kNsPerSecond});  // for all that follows to connect
  const SessionTicket forgotten = ticket(), used = ticket();
  auto client = connect(used);
  ASSERT_TRUE(client.ok()) << client.status();
  EXPECT_TRUE(display_until(**client, [&](const client::Pair*) {
    return absl::IsNotFound(server_->stats(forgotten.session).status());
  }));
  EXPECT_EQ(server_->sessions(), 1u);
  EXPECT_TRUE((*client)->status().ok()) << (*client)->status();
  client->reset();
  const TimeNs give_up = clock_.now() + test::kPatienceNs;
  while (server_->sessions() > 0 && clock_.now() < give_up) std::this_thread::yield();
  EXPECT_EQ(server_->sessions(), 0u);
}

// Whoever of the two is first, the client hears of it, and the server forgets it.
TEST_F(StreamServerThreadsTest, SessionsEndWhileTheirClientsConnect) {
  start();
  for (int i = 0; i < 200; ++i) {
    const SessionTicket mine = ticket();
    std::thread end([&] { EXPECT_TRUE(server_->end_session(mine.session, "over").ok()); });
    const auto client = connect(mine);
    end.join();
    if (client.ok()) {
      EXPECT_TRUE(display_until(**client, [&](const client::Pair*) { return !(*client)->status().ok(); }));
    } else {
      EXPECT_FALSE(absl::IsDeadlineExceeded(client.status())) << client.status();
    }
  }
}

TEST_F(StreamServerThreadsTest, ShutdownTellsAllThatStream) {
  start();
  std::atomic<int> streaming = 0;
  std::vector<std::thread> clients;
  for (int i = 0; i < 4; ++i) {
    clients.emplace_back([&, mine = ticket()] {
      const auto client = connect(mine);
      ASSERT_TRUE(client.ok()) << client.status();
      bool seen = false;
      EXPECT_TRUE(display_until(**client, [&](const client::Pair* pair) {
        if (pair && !std::exchange(seen, true)) ++streaming;
        return !(*client)->status().ok();
      }));
      EXPECT_TRUE(absl::IsCancelled((*client)->status())) << (*client)->status();
    });
  }
  const TimeNs give_up = clock_.now() + test::kPatienceNs;
  while (streaming < 4 && clock_.now() < give_up) std::this_thread::yield();
  EXPECT_EQ(streaming, 4);
  server_.reset();
  for (std::thread& client : clients) client.join();
}

TEST_F(StreamServerThreadsTest, StrangersDisturbNobody) {
  start();
  const SessionTicket mine = ticket();
  const auto client = connect(mine);
  ASSERT_TRUE(client.ok()) << client.status();
  std::atomic<bool> done = false;
  std::thread guesser([&] {
    SessionTicket wrong = mine;
    while (!done) {
      ++wrong.token[0];
      if (wrong.token == mine.token) continue;
      EXPECT_TRUE(absl::IsUnauthenticated(connect(wrong).status()));
    }
  });
  std::thread flooder([&] {
    asio::io_context io;
    asio::ip::udp::socket socket(io, asio::ip::udp::v4());
    const asio::ip::udp::endpoint port(asio::ip::address_v4::loopback(), mine.media_port);
    std::minstd_rand random(1);
    transport::HelloDatagram hello{};
    for (uint64_t i = 0; !done; ++i) {
      for (uint8_t& byte : hello.token) byte = static_cast<uint8_t>(random() >> 8);
      hello.nonce = i;
      auto datagram = transport::write_hello(hello);
      if (i % 2) datagram[0] = static_cast<uint8_t>(i / 2);  // also RTP, RTCP, poses, and nothing of all
      transport::SystemError ignored;
      socket.send_to(asio::buffer(datagram), port, 0, ignored);
    }
  });
  expect_pairs(**client, 10);
  done = true;
  guesser.join();
  flooder.join();
  EXPECT_EQ((*client)->stats().core.decode_errors, 0u);
  EXPECT_EQ((*client)->stats().core.orphans, 0u);
}

}  // namespace
}  // namespace tessera::server
