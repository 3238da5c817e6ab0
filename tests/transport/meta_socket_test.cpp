// The meta connection over real sockets on loopback, plain and with TLS.
#include <gmock/gmock.h>

#include <boost/asio/read.hpp>
#include <boost/asio/write.hpp>

#include "asio_fixture.h"
#include "certificate.h"
#include "test_streams.h"
#include "transport/asio/meta_client.h"
#include "transport/asio/meta_listener.h"

namespace tessera::transport {
namespace {

using asio::ip::tcp;
using test::Bytes;
using test::from_hex;
using ::testing::HasSubstr;

SessionToken token(uint8_t v) {
  SessionToken t;
  t.fill(v);
  return t;
}

class MetaSockets : public test::AsioTest {
 protected:
  void listen(MetaListenerSettings settings = {}) {
    auto opened = MetaListener::open(io.get_executor(), settings,
                                     [this](const Hello& hello, const std::string&) { return admit(hello); });
    ASSERT_TRUE(opened.ok()) << opened.status();
    listener = *opened;
  }
  StatusOr<Admission> admit(const Hello& hello) {
    if (!equal_in_constant_time(hello.token, token(1)))
      return absl::UnauthenticatedError("no session has this token");
    Admission a;
    a.welcome.session = 7;
    a.welcome.media_port = 5004;
    a.welcome.frames_per_second = 30;
    a.events.on_frame = [this](FrameType type, std::span<const uint8_t> payload) {
      at_server.emplace_back(type, Bytes(payload.begin(), payload.end()));
      return absl::OkStatus();
    };
    a.events.on_closed = [this](const Status& s) { server_closed = s; };
    a.on_connected = [this](std::shared_ptr<MetaConnection> c) { server = std::move(c); };
    return a;
  }
  MetaClientSettings client_settings(uint8_t token_byte = 1) const {
    MetaClientSettings s;
    s.server_port = listener->port();
    s.hello.token = token(token_byte);
    s.hello.client = {640, 480, {{}}, 60, "test"};
    return s;
  }
  void connect(const MetaClientSettings& settings) {
    MetaConnectionEvents events;
    events.on_frame = [this](FrameType type, std::span<const uint8_t> payload) {
      at_client.emplace_back(type, Bytes(payload.begin(), payload.end()));
      return absl::OkStatus();
    };
    events.on_closed = [this](const Status& s) { client_closed = s; };
    connect_meta(io.get_executor(), settings, events, [this](auto result, const Welcome& w) {
      connected = std::move(result);
      welcome = w;
    });
    ASSERT_TRUE(run_until([&] { return connected.has_value(); }));
  }
  // A client that does only what the test says.
  tcp::socket raw_client() {
    tcp::socket socket(io);
    socket.connect({asio::ip::make_address("127.0.0.1"), listener->port()});
    return socket;
  }
  void say_hello(tcp::socket& socket) {
    Bytes frame;
    ASSERT_TRUE(write_frame(FrameType::hello, encode(client_settings().hello), frame).ok());
    asio::write(socket, asio::buffer(frame));
    ASSERT_TRUE(run_until([&] { return server != nullptr; }));
  }
  void TearDown() override {
    if (connected && connected->ok()) (**connected)->close(absl::OkStatus());
    if (server) server->close(absl::OkStatus());
    if (listener) listener->close();
    server.reset();
    connected.reset();
    io.restart();
    io.run_for(std::chrono::milliseconds(20));
  }

  using Frames = std::vector<std::pair<FrameType, Bytes>>;
  std::shared_ptr<MetaListener> listener;
  std::shared_ptr<MetaConnection> server;
  std::optional<StatusOr<std::shared_ptr<MetaConnection>>> connected;
  Welcome welcome;
  Frames at_server, at_client;
  std::optional<Status> server_closed, client_closed;
};

TEST_F(MetaSockets, FramesCrossBothWaysInOrder) {
  listen();
  connect(client_settings());
  ASSERT_TRUE(connected->ok()) << connected->status();
  EXPECT_EQ(welcome.session, 7u);
  Frames down, up;
  for (size_t i = 0; i < 100; ++i) {
    down.emplace_back(FrameType::meta, Bytes(i * i * 7, static_cast<uint8_t>(i)));
    up.emplace_back(FrameType::timing, Bytes(i * 3, static_cast<uint8_t>(i)));
    ASSERT_TRUE(server->send(down.back().first, down.back().second).ok());
    ASSERT_TRUE((**connected)->send(up.back().first, up.back().second).ok());
  }
  ASSERT_TRUE(run_until([&] { return at_client.size() == 100 && at_server.size() == 100; }));
  EXPECT_EQ(at_client, down);
  EXPECT_EQ(at_server, up);
  server->close(absl::OkStatus());
  ASSERT_TRUE(run_until([&] { return client_closed && server_closed; }));
  EXPECT_TRUE(client_closed->ok()) << *client_closed;
  EXPECT_TRUE(server_closed->ok()) << *server_closed;
  EXPECT_FALSE(server->send(FrameType::meta, {}).ok());
}

TEST_F(MetaSockets, AByeMayHaveAReason) {
  listen();
  connect(client_settings());
  server->close(absl::CancelledError("closing time"));
  ASSERT_TRUE(run_until([&] { return client_closed && server_closed; }));
  EXPECT_EQ(*client_closed, absl::CancelledError("closing time"));
  EXPECT_EQ(*server_closed, absl::CancelledError("closing time"));
}

TEST_F(MetaSockets, AWrongTokenIsRefusedByName) {
  listen();
  connect(client_settings(2));
  EXPECT_EQ(connected->status().code(), absl::StatusCode::kUnauthenticated);
  EXPECT_THAT(std::string(connected->status().message()), HasSubstr("no session has this token"));
}

TEST_F(MetaSockets, AnotherVersionIsRefusedByName) {
  listen();
  MetaClientSettings settings = client_settings();
  settings.hello.version = 9;
  connect(settings);
  EXPECT_EQ(connected->status().code(), absl::StatusCode::kUnimplemented);
  EXPECT_THAT(std::string(connected->status().message()), HasSubstr("version 9"));
}

TEST_F(MetaSockets, FailuresNameTheStep) {
  listen();
  MetaClientSettings settings = client_settings();
  listener->close();
  connect(settings);
  EXPECT_EQ(connected->status().code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(connected->status().message()),
              HasSubstr(absl::StrCat("127.0.0.1:", settings.server_port)));
  EXPECT_THAT(std::string(connected->status().message()), HasSubstr("connect"));
}

TEST(MetaConnection, ErrorsKeepTheirMeaningOnTheWire) {
  for (const auto code :
       {absl::StatusCode::kInternal, absl::StatusCode::kUnauthenticated, absl::StatusCode::kUnimplemented,
        absl::StatusCode::kInvalidArgument, absl::StatusCode::kDeadlineExceeded,
        absl::StatusCode::kResourceExhausted, absl::StatusCode::kFailedPrecondition}) {
    const auto sent = encode(ErrorMessage{error_code(Status(code, "why")), "why"});
    EXPECT_EQ(to_status(*decode_error(sent)).code(), code);
  }
  EXPECT_EQ(error_code(absl::FailedPreconditionError("")), ErrorCode::busy);
  EXPECT_EQ(error_code(absl::NotFoundError("the session has ended")), ErrorCode::bad_token);
  EXPECT_EQ(to_status({static_cast<ErrorCode>(77), "newer"}).code(), absl::StatusCode::kInternal);
}

TEST_F(MetaSockets, ABusyPortSaysWhatWhereAndWhatToDo) {
  listen();
  const Status status = MetaListener::open(io.get_executor(), {.port = listener->port()}, {}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kAlreadyExists);
  EXPECT_THAT(std::string(status.message()), HasSubstr(absl::StrCat("TCP 127.0.0.1:", listener->port())));
}

// A silent server: the timeout names what was waited for.
TEST_F(MetaSockets, ASilentServerTimesOut) {
  tcp::acceptor silent(io, {asio::ip::make_address("127.0.0.1"), 0});
  MetaClientSettings settings;
  settings.server_port = silent.local_endpoint().port();
  settings.connect_timeout_ns = 100 * kNsPerMs;
  connect(settings);
  EXPECT_EQ(connected->status().code(), absl::StatusCode::kDeadlineExceeded);
  EXPECT_THAT(std::string(connected->status().message()), HasSubstr("hello"));
}

// RELIABILITY R10: metas wait for a stalled peer, whole and in order, and go on with it.
TEST_F(MetaSockets, MetasWaitForAStalledPeer) {
  listen({.connection = {.max_queued_bytes = 64u << 20, .stall_timeout_ns = 60 * kNsPerSecond}});
  tcp::socket client = raw_client();
  say_hello(client);
  Frames sent;
  for (int i = 0; i < 300; ++i) {
    sent.emplace_back(FrameType::meta, Bytes(100'000, static_cast<uint8_t>(i)));
    ASSERT_TRUE(server->send(FrameType::meta, sent.back().second).ok());
  }
  // The system's buffers take some of it; the rest waits here.
  const size_t all = server->queued_bytes();
  ASSERT_TRUE(run_until([&] { return server->queued_bytes() < all; }));
  EXPECT_GT(server->queued_bytes(), 1u << 20);

  FrameParser parser;
  Frames received;
  Bytes buffer(1 << 20);
  std::function<void()> read = [&] {
    client.async_read_some(asio::buffer(buffer), [&](SystemError e, size_t n) {
      if (e) return;
      ASSERT_TRUE(parser
                      .feed(std::span(buffer).first(n),
                            [&](FrameType type, auto payload) {
                              if (type == FrameType::meta)
                                received.emplace_back(type, Bytes(payload.begin(), payload.end()));
                              return absl::OkStatus();
                            })
                      .ok());
      read();
    });
  };
  read();
  ASSERT_TRUE(run_until([&] { return received.size() == sent.size(); }));
  EXPECT_TRUE(received == sent);
  EXPECT_EQ(server->queued_bytes(), 0u);
  client.close();
  ASSERT_TRUE(run_until([&] { return server_closed.has_value(); }));
}

TEST_F(MetaSockets, AQueueBeyondItsLimitClosesWithTheReason) {
  listen({.connection = {.max_queued_bytes = 1u << 20}});
  tcp::socket client = raw_client();
  say_hello(client);
  Status status;
  size_t most = 0;
  for (int i = 0; i < 1000 && status.ok(); ++i) {
    status = server->send(FrameType::meta, Bytes(100'000));
    most = std::max(most, server->queued_bytes());
    io.restart();
    io.poll();
  }
  EXPECT_EQ(error_code(status), ErrorCode::too_slow);
  EXPECT_THAT(std::string(status.message()), HasSubstr("max_queued_bytes (1048576)"));
  EXPECT_LE(most, 1u << 20);
  ASSERT_TRUE(run_until([&] { return server_closed.has_value(); }));
  EXPECT_EQ(*server_closed, status);
  EXPECT_EQ(server->queued_bytes(), 0u);
}

TEST_F(MetaSockets, APeerThatTakesNothingIsClosed) {
  listen({.connection = {.max_queued_bytes = 64u << 20, .stall_timeout_ns = 50 * kNsPerMs}});
  tcp::socket client = raw_client();
  say_hello(client);
  for (int i = 0; i < 300; ++i) ASSERT_TRUE(server->send(FrameType::meta, Bytes(100'000)).ok());
  ASSERT_TRUE(run_until([&] { return server_closed.has_value(); }));
  EXPECT_EQ(server_closed->code(), absl::StatusCode::kDeadlineExceeded);
  EXPECT_THAT(std::string(server_closed->message()), HasSubstr("took no data"));
}

TEST_F(MetaSockets, APeerThatTakesLittleCannotHoldTheClose) {
  listen({.connection = {.max_queued_bytes = 64u << 20, .close_timeout_ns = 100 * kNsPerMs}});
  tcp::socket client = raw_client();
  say_hello(client);
  for (int i = 0; i < 300; ++i) ASSERT_TRUE(server->send(FrameType::meta, Bytes(100'000)).ok());
  server->close(absl::OkStatus());
  Bytes buffer(64 << 10);
  asio::steady_timer pause(io);
  size_t taken = 0;
  const auto over = std::make_shared<bool>(false);  // outlives the test's body, as a handler under way does
  std::function<void()> sip = [&, over] {
    pause.expires_after(std::chrono::milliseconds(20));
    pause.async_wait([&, over](SystemError cancelled) {
      if (cancelled || *over) return;
      SystemError error;
      taken += client.read_some(asio::buffer(buffer), error);
      if (!error || error == asio::error::would_block) sip();
    });
  };
  client.non_blocking(true);
  sip();
  const bool closed = run_until([&] { return server_closed.has_value(); });
  *over = true;
  ASSERT_TRUE(closed);
  EXPECT_LT(taken, 10'000'000u);
  EXPECT_EQ(server->queued_bytes(), 0u);
}

TEST_F(MetaSockets, StrangersAreClosed) {
  listen({.hello_timeout_ns = 100 * kNsPerMs});
  const Bytes cases[] = {
      {},                                        // says nothing
      from_hex("474554202f20485454502f312e31"),  // "GET / HTTP/1.1"
      from_hex("00000000 03"),                   // meta before hello
      from_hex("00010000 01"),                   // a hello too long
      from_hex("00000003 01 000100"),            // a hello too short
  };
  for (const Bytes& bytes : cases) {
    tcp::socket client = raw_client();
    asio::write(client, asio::buffer(bytes));
    bool ended = false;
    Bytes buffer(4096);
    std::function<void()> read = [&] {
      client.async_read_some(asio::buffer(buffer),
                             [&](SystemError e, size_t) { e ? void(ended = true) : read(); });
    };
    read();
    ASSERT_TRUE(run_until([&] { return ended; }));
  }
  EXPECT_EQ(server, nullptr);
}

TEST_F(MetaSockets, WaitingConnectionsAreBounded) {
  listen({.hello_timeout_ns = 60 * kNsPerSecond, .max_waiting = 3});
  std::vector<tcp::socket> clients;
  int ended = 0;
  Bytes buffer(16);
  for (int i = 0; i < 10; ++i) {
    clients.push_back(raw_client());
    clients.back().async_read_some(asio::buffer(buffer), [&](SystemError, size_t) { ++ended; });
  }
  ASSERT_TRUE(run_until([&] { return ended == 7; }));
  for (tcp::socket& c : clients) c.close();
  ASSERT_TRUE(run_until([&] { return ended == 10; }));
}

TEST_F(MetaSockets, TlsCarriesTheSameAndChecksTheServer) {
  const test::Certificate certificate("tessera.test");
  const auto server_tls = TlsContext::server({certificate.certificate_file(), certificate.key_file()});
  ASSERT_TRUE(server_tls.ok()) << server_tls.status();
  listen({.tls = *server_tls});
  MetaClientSettings settings = client_settings();
  settings.tls = *TlsContext::client({certificate.certificate_file(), "tessera.test"});
  connect(settings);
  ASSERT_TRUE(connected->ok()) << connected->status();
  const Bytes payload(300'000, 5);
  ASSERT_TRUE(server->send(FrameType::meta, payload).ok());
  ASSERT_TRUE((**connected)->send(FrameType::timing, Bytes{1}).ok());
  ASSERT_TRUE(run_until([&] { return at_client.size() == 1 && at_server.size() == 1; }));
  EXPECT_EQ(at_client[0].second, payload);
}

TEST_F(MetaSockets, TlsRefusesAnotherNameAnUnknownAuthorityAndPlainText) {
  const test::Certificate certificate("tessera.test"), other("tessera.test");
  listen({.tls = *TlsContext::server({certificate.certificate_file(), certificate.key_file()})});
  for (const TlsClientSettings& tls : {TlsClientSettings{certificate.certificate_file(), "elsewhere.test"},
                                       TlsClientSettings{other.certificate_file(), "tessera.test"}}) {
    MetaClientSettings settings = client_settings();
    settings.tls = *TlsContext::client(tls);
    connected.reset();
    connect(settings);
    EXPECT_EQ(connected->status().code(), absl::StatusCode::kUnavailable);
    EXPECT_THAT(std::string(connected->status().message()), HasSubstr("TLS handshake"));
  }
  connected.reset();
  connect(client_settings());
  EXPECT_FALSE(connected->ok());
  EXPECT_EQ(server, nullptr);
}

TEST(Tls, FilesThatDoNotFitAreNamed) {
  const Status status = TlsContext::server({"/no/such.pem", "/no/such.key"}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), HasSubstr("/no/such.pem"));
}

}  // namespace
}  // namespace tessera::transport
