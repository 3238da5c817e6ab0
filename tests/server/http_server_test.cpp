#include "server/http_server.h"

#include <gmock/gmock.h>

#include <boost/asio/ssl.hpp>
#include <random>
#include <vector>

#include "../transport/certificate.h"
#include "http_client.h"
#include "server/status_pages.h"

namespace tessera::server {
namespace {

using test::ask;
using test::get;
using testing::EndsWith;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;
namespace asio = boost::asio;

class HttpServerTest : public testing::Test {
 protected:
  void start(const HttpServerSettings& settings = {}) {
    auto server = HttpServer::open(settings, [](std::string_view path) {
      if (path != "/here") return HttpResponse{.status = 404, .body = "not here\n"};
      return HttpResponse{.body = std::string(100'000, 'x')};
    });
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
  }
  uint16_t port() const { return server_->port(); }

  std::unique_ptr<HttpServer> server_;
};

TEST_F(HttpServerTest, AnswersGetAndHead) {
  start();
  const std::string answer = get(port(), "/here?and=there");
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 200 OK\r\n"));
  EXPECT_EQ(test::body_of(answer), std::string(100'000, 'x'));
  const std::string head = ask(port(), "HEAD /here HTTP/1.1\r\nHost: t\r\n\r\n");
  EXPECT_THAT(head, HasSubstr("Content-Length: 100000\r\n"));
  EXPECT_THAT(test::body_of(head), IsEmpty());
  EXPECT_THAT(get(port(), "/there"), StartsWith("HTTP/1.1 404 "));
}

TEST_F(HttpServerTest, OtherMethodsAreRefused) {
  start();
  for (const char* method : {"POST", "PUT", "DELETE", "OPTIONS", "TRACE"}) {
    const std::string answer =
        ask(port(), std::string(method) + " /here HTTP/1.1\r\nHost: t\r\nContent-Length: 0\r\n\r\n");
    EXPECT_THAT(answer, StartsWith("HTTP/1.1 405 ")) << method;
    EXPECT_THAT(answer, HasSubstr("Allow: GET, HEAD\r\n")) << method;
  }
  EXPECT_THAT(ask(port(), "POST /here HTTP/1.1\r\nHost: t\r\nContent-Length: 99999999\r\n\r\nxyz", true),
              StartsWith("HTTP/1.1 405 "));
}

TEST_F(HttpServerTest, WhatIsNoRequestIsRefusedAndTheServerLivesOn) {
  start();
  std::mt19937 random(1);
  for (int i = 0; i < 200; ++i) {
    std::string garbage(random() % 3000, '\0');
    for (char& c : garbage) c = static_cast<char>(random());
    garbage += "\r\n\r\n";
    const std::string answer = ask(port(), garbage, true);
    EXPECT_THAT(answer, StartsWith("HTTP/1.1 4")) << i;
  }
  for (const char* wrong : {"GET\r\n\r\n", "GET / HTTP/9.9\r\n\r\n", "GET / HTTP/1.1\r\nbad header\r\n\r\n",
                            "GET /a b HTTP/1.1\r\n\r\n", "\r\n\r\n\r\n"}) {
    EXPECT_THAT(ask(port(), wrong, true), StartsWith("HTTP/1.1 400 ")) << wrong;
  }
  EXPECT_THAT(get(port(), "/here"), StartsWith("HTTP/1.1 200 "));
}

TEST_F(HttpServerTest, AHeaderTooLongIsRefusedBeforeItEnds) {
  start({.max_header_bytes = 1000});
  const std::string line = "X: " + std::string(100, 'x') + "\r\n";
  std::string request = "GET /here HTTP/1.1\r\n";
  for (int i = 0; i < 5; ++i) request += line;
  EXPECT_THAT(ask(port(), request + "\r\n"), StartsWith("HTTP/1.1 200 "));
  for (int i = 0; i < 1000; ++i) request += line;
  EXPECT_THAT(ask(port(), request, true), StartsWith("HTTP/1.1 431 "));
  EXPECT_THAT(ask(port(), "GET /" + std::string(5000, 'x'), true), StartsWith("HTTP/1.1 431 "));
}

// Both ends of the limits: one who says nothing is thrown out, and does not keep others away for longer.
TEST_F(HttpServerTest, SlowClientsAreThrownOutAndTheirNumberIsBounded) {
  start({.max_connections = 3, .timeout_ns = 200 * kNsPerMs});
  asio::io_context io;
  std::vector<asio::ip::tcp::socket> slow;
  for (int i = 0; i < 3; ++i) {
    slow.emplace_back(io).connect(test::loopback(port()));
    // The byte is answered by nothing, but the connection counts by then.
    asio::write(slow.back(), asio::buffer("G", 1));
  }
  for (auto& socket : slow) EXPECT_THAT(test::exchange(socket, "E"), IsEmpty()) << "closed without an answer";
  EXPECT_THAT(get(port(), "/here"), StartsWith("HTTP/1.1 200 "));
}

TEST_F(HttpServerTest, ConnectionsBeyondTheLimitAreClosedAtOnce) {
  start({.max_connections = 1, .timeout_ns = 60 * kNsPerSecond});
  asio::io_context io;
  asio::ip::tcp::socket first(io), second(io);
  first.connect(test::loopback(port()));  // accepted in the order of connecting
  second.connect(test::loopback(port()));
  EXPECT_THAT(test::exchange(second, "GET /here HTTP/1.1\r\nHost: t\r\n\r\n"), IsEmpty());
  EXPECT_THAT(test::exchange(first, "GET /here HTTP/1.1\r\nHost: t\r\n\r\n"), StartsWith("HTTP/1.1 200 "));
}

TEST_F(HttpServerTest, ItEndsWhileClientsHang) {
  start({.timeout_ns = 3600 * kNsPerSecond});
  asio::io_context io;
  asio::ip::tcp::socket socket(io);
  socket.connect(test::loopback(port()));
  asio::write(socket, asio::buffer("GET /he", 7));
  server_.reset();
  EXPECT_THAT(test::exchange(socket, ""), IsEmpty());
}

TEST_F(HttpServerTest, SpeaksTlsWithACertificate) {
  const transport::test::Certificate certificate("localhost");
  const auto tls = transport::TlsContext::server({certificate.certificate_file(), certificate.key_file()});
  ASSERT_TRUE(tls.ok()) << tls.status();
  start({.tls = *tls, .timeout_ns = kNsPerSecond});
  asio::io_context io;
  asio::ssl::context trust(asio::ssl::context::tls_client);
  trust.load_verify_file(certificate.certificate_file());
  trust.set_verify_mode(asio::ssl::verify_peer);
  asio::ssl::stream<asio::ip::tcp::socket> stream(io, trust);
  stream.lowest_layer().connect(test::loopback(port()));
  stream.handshake(asio::ssl::stream_base::client);
  EXPECT_THAT(test::exchange(stream, "GET /here HTTP/1.1\r\nHost: t\r\n\r\n"), EndsWith("xxx"));
  EXPECT_THAT(get(port(), "/here"), testing::Not(HasSubstr("200"))) << "clear text";
}

TEST_F(HttpServerTest, ABusyPortIsNamed) {
  start();
  const auto second = HttpServer::open({.port = port()}, {});
  ASSERT_FALSE(second.ok());
  EXPECT_THAT(std::string(second.status().message()), HasSubstr(std::to_string(port())));
}

TEST(StatusPages, ReadyOnlyWhileServing) {
  StatusPages pages;
  EXPECT_EQ(pages.get("/healthz").status, 200u);
  EXPECT_EQ(pages.get("/readyz").status, 503u);
  EXPECT_THAT(pages.get("/readyz").body, HasSubstr("loading"));
  pages.set_state(StatusPages::State::serving);
  EXPECT_EQ(pages.get("/readyz").status, 200u);
  pages.set_state(StatusPages::State::draining);
  EXPECT_EQ(pages.get("/readyz").status, 503u);
  EXPECT_THAT(pages.get("/readyz").body, HasSubstr("draining"));
  EXPECT_EQ(pages.get("/healthz").status, 200u);
  EXPECT_EQ(pages.get("/").status, 404u);
  EXPECT_EQ(pages.get("/metrics/../etc/passwd").status, 404u);
}

TEST(StatusPages, MetricsComeAndGoWithWhatTheyMeasure) {
  StatusPages pages;
  EXPECT_EQ(pages.get("/metrics").status, 503u);
  pages.set_metrics([] { return std::string("a 1\n"); });
  EXPECT_EQ(pages.get("/metrics").body, "a 1\n");
  pages.set_metrics({});
  EXPECT_EQ(pages.get("/metrics").status, 503u);
}

}  // namespace
}  // namespace tessera::server
