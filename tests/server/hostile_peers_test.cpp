// R13: whatever a stranger sends, it gets a clear error, and who streams does not notice.
#include <gmock/gmock.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/write.hpp>
#include <optional>
#include <string>

#include "streaming_fixture.h"
#include "transport/asio/asio.h"
#include "transport/frame_io.h"
#include "transport/messages.h"

namespace tessera::server {
namespace {

namespace asio = transport::asio;
using asio::ip::tcp;
using testing::HasSubstr;
using transport::ErrorCode;
using transport::FrameType;
using Bytes = std::vector<uint8_t>;

class HostilePeersTest : public test::FakeStreamingTest {
 protected:
  void SetUp() override { begin({}); }
  void begin(const StreamServerSettings& settings) {
    start(settings);
    auto client = connect(ticket());
    ASSERT_TRUE(client.ok()) << client.status();
    client_ = *std::move(client);
  }
  // The one that streams all along.
  void TearDown() override {
    if (!client_) return;
    expect_pairs(*client_, 5);
    EXPECT_EQ(client_->stats().core.decode_errors, 0u);
    EXPECT_EQ(client_->stats().core.orphans, 0u);
    client_.reset();
  }

  tcp::socket knock() {
    tcp::socket socket(io_);
    socket.connect({asio::ip::address_v4::loopback(), server_->meta_port()});
    return socket;
  }
  // The error that the server says before it closes.
  std::optional<transport::ErrorMessage> error_from(tcp::socket& socket) {
    Bytes answer(1 << 16);
    transport::SystemError end;
    answer.resize(asio::read(socket, asio::buffer(answer), end));
    std::optional<transport::ErrorMessage> error;
    transport::FrameParser parser(1 << 16);
    (void)parser.feed(answer, [&](FrameType type, std::span<const uint8_t> payload) {
      if (type != FrameType::error) return absl::OkStatus();
      const auto message = transport::decode_error(payload);
      EXPECT_TRUE(message.ok()) << message.status();
      if (message.ok()) error = *message;
      return absl::OkStatus();
    });
    return error;
  }
  std::optional<transport::ErrorMessage> answer_to(const Bytes& bytes) {
    tcp::socket socket = knock();
    transport::SystemError ignored;
    asio::write(socket, asio::buffer(bytes), ignored);
    socket.shutdown(tcp::socket::shutdown_send, ignored);
    return error_from(socket);
  }

  static Bytes frame(FrameType type, const Bytes& payload) {
    Bytes out;
    EXPECT_TRUE(transport::write_frame(type, payload, out).ok());
    return out;
  }
  static Bytes hello(const SessionTicket& ticket) {
    return frame(FrameType::hello, transport::encode(transport::Hello{.token = ticket.token,
                                                                      .client = connection(ticket).client}));
  }

  asio::io_context io_;
  std::unique_ptr<client::Connection> client_;
};

TEST_F(HostilePeersTest, WhatIsNoProtocolIsAnswered) {
  const auto expect = [&](const Bytes& bytes, ErrorCode code, const char* words) {
    const auto error = answer_to(bytes);
    ASSERT_TRUE(error.has_value()) << words;
    EXPECT_EQ(error->code, code) << error->text;
    EXPECT_THAT(error->text, HasSubstr(words));
  };
  const std::string request = "GET /index.html HTTP/1.1\r\nHost: here\r\n\r\n";
  expect(Bytes(request.begin(), request.end()), ErrorCode::malformed, "type");
  expect({0xff, 0xff, 0xff, 0xff, 1}, ErrorCode::malformed, "4294967295 bytes exceeds");
  expect({0, 0, 0, 0, 77}, ErrorCode::malformed, "type 77");
  expect(Bytes(100'000, 0), ErrorCode::malformed, "type 0");
  expect(frame(FrameType::ping, Bytes(12)), ErrorCode::malformed, "hello");
  expect(frame(FrameType::hello, Bytes(20, 0)), ErrorCode::unsupported_version, "version");
  EXPECT_FALSE(answer_to({0, 0, 0, 50, 1, 0, 1})) << "it hung up amid its hello";
}

TEST_F(HostilePeersTest, AClientThatTurnsBadEndsOnlyItsOwnConnection) {
  const Bytes bad[] = {frame(FrameType::meta, Bytes(8)),
                       frame(FrameType::timing, Bytes(3)),
                       frame(FrameType::pose, Bytes(51)),
                       frame(FrameType::bye, {0, 1, 0xff}),
                       frame(FrameType::error, {0, 1, 0, 1, 0xff}),
                       Bytes{0x7f, 0, 0, 0, 4},
                       Bytes{0, 0, 0, 0, 200}};
  const SessionTicket mine = ticket();
  for (const Bytes& tail : bad) {
    Bytes bytes = hello(mine);
    bytes.insert(bytes.end(), tail.begin(), tail.end());
    std::optional<transport::ErrorMessage> error = answer_to(bytes);
    const TimeNs give_up = clock_.now() + test::kPatienceNs;
    while (error && error->code == ErrorCode::busy && clock_.now() < give_up)  // the one before still leaves
      error = answer_to(bytes);
    ASSERT_TRUE(error.has_value());
    EXPECT_EQ(error->code, ErrorCode::malformed) << error->text;
  }
}

// As after kill -9: the system closes the sockets, nobody says bye.
TEST_F(HostilePeersTest, AClientThatDiesMayComeAgainWithItsTicket) {
  const SessionTicket mine = ticket();
  for (int death = 0; death < 3; ++death) {
    tcp::socket socket = knock();
    asio::write(socket, asio::buffer(hello(mine)));
    Bytes welcome(5);
    asio::read(socket, asio::buffer(welcome));
    EXPECT_EQ(welcome[4], static_cast<uint8_t>(FrameType::welcome));
    socket.set_option(asio::socket_base::linger(true, 0));  // a reset instead of an orderly end
    socket.close();
    const TimeNs give_up = clock_.now() + test::kPatienceNs;
    auto again = connect(mine);
    while (absl::IsFailedPrecondition(again.status()) && clock_.now() < give_up) again = connect(mine);
    ASSERT_TRUE(again.ok()) << again.status();
    expect_pairs(**again, 2);
    again->reset();
    while (server_->stats(mine.session)->connected && clock_.now() < give_up) std::this_thread::yield();
  }
}

TEST_F(HostilePeersTest, SilentConnectionsAreBoundedAndTheRestIsTold) {
  client_.reset();
  server_.reset();
  StreamServerSettings settings;
  settings.meta.max_waiting = 8;
  settings.meta.hello_timeout_ns = kNsPerSecond;
  begin(settings);
  const SessionTicket mine = ticket();
  std::vector<tcp::socket> silent;
  for (int i = 0; i < 8; ++i) silent.push_back(knock());
  const auto refused = connect(mine);
  EXPECT_TRUE(absl::IsResourceExhausted(refused.status())) << refused.status();
  EXPECT_THAT(std::string(refused.status().message()), HasSubstr("try again"));
  for (tcp::socket& socket : silent) {
    const auto error = error_from(socket);
    ASSERT_TRUE(error.has_value());
    EXPECT_EQ(error->code, ErrorCode::too_slow);
    EXPECT_THAT(error->text, HasSubstr("hello"));
  }
  const auto admitted = connect(mine);
  ASSERT_TRUE(admitted.ok()) << admitted.status();
  expect_pairs(**admitted, 2);
}

}  // namespace
}  // namespace tessera::server
