// Whole sessions over TLS and SRTP, and what a client is told when it cannot connect: the step that failed,
// in time (RELIABILITY R1).
#include <gmock/gmock.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ssl.hpp>

#include "../transport/certificate.h"
#include "daemon_fixture.h"
#include "http_client.h"

namespace tessera::server {
namespace {

using testing::AnyOf;
using testing::HasSubstr;
using transport::test::Certificate;
namespace asio = boost::asio;
using asio::ip::tcp;

class ConnectTest : public DaemonTest {
 protected:
  DaemonSettings with_tls() const {
    return {.tls_certificate = certificate_.certificate_file(),
            .tls_key = certificate_.key_file(),
            .scenes = {"hall=gallery:0"}};
  }
  static std::shared_ptr<transport::TlsContext> trust(const Certificate& certificate) {
    auto tls = transport::TlsContext::client({certificate.certificate_file(), "localhost"});
    EXPECT_TRUE(tls.ok()) << tls.status();
    return *tls;
  }
  client::ConnectionSettings settings_for_new_session() {
    v1::Ticket ticket;
    const grpc::Status created = create("hall", &ticket);
    EXPECT_TRUE(created.ok()) << created.error_message();
    return connection_settings(ticket);
  }
  // Why it does not connect.
  std::string failure(const client::ConnectionSettings& settings) {
    const TimeNs start = clock_.now();
    const auto connection = client::Connection::connect(settings, clock_);
    EXPECT_FALSE(connection.ok());
    EXPECT_LT(clock_.now() - start, 10 * kNsPerSecond);
    return std::string(connection.status().message());
  }

  const Certificate certificate_{"localhost"};
};

TEST_F(ConnectTest, AWholeSessionOverTlsAndSrtp) {
  start(with_tls());
  client::ConnectionSettings settings = settings_for_new_session();
  settings.tls = trust(certificate_);
  auto client = client::Connection::connect(settings, clock_);
  ASSERT_TRUE(client.ok()) << client.status();
  EXPECT_TRUE((*client)->welcome().srtp.has_value());
  FrameNumber newest = 0;
  for (int i = 0; i < 3; ++i) {
    const client::Pair* pair = first_pair(**client);
    ASSERT_NE(pair, nullptr) << (*client)->status();
    EXPECT_GT(pair->frame, newest);
    newest = pair->frame;
  }
  EXPECT_EQ((*client)->stats().core.decode_errors, 0u);
  EXPECT_EQ((*client)->stats().core.orphans, 0u);
}

// All four ports, not the stream's alone.
TEST_F(ConnectTest, ClearTextIsRefusedWhereThereIsACertificate) {
  start(with_tls());
  grpc::ClientContext context;
  v1::ServerInfo info;
  const auto clear = v1::Control::NewStub(channel(""));
  EXPECT_FALSE(clear->GetServerInfo(&context, {}, &info).ok());
  EXPECT_THAT(test::get(daemon_->http_port(), "/healthz"), testing::Not(HasSubstr("200")));
}

TEST_F(ConnectTest, NobodyListens) {
  start({.scenes = {"hall=gallery:0"}});
  client::ConnectionSettings settings = settings_for_new_session();
  settings.meta_port = daemon_->media_port();  // free, as TCP
  EXPECT_THAT(failure(settings), AllOf(HasSubstr("connect"), HasSubstr(std::to_string(settings.meta_port)),
                                       HasSubstr("does tesserad run there")));
}

TEST_F(ConnectTest, AnotherServicesPort) {
  start({.scenes = {"hall=gallery:0"}});
  client::ConnectionSettings settings = settings_for_new_session();
  settings.meta_port = daemon_->control_port();
  settings.connect_timeout_ns = kNsPerSecond;
  EXPECT_THAT(failure(settings), AllOf(HasSubstr("hello"), HasSubstr("meta port")));
}

TEST_F(ConnectTest, AWrongToken) {
  start({.scenes = {"hall=gallery:0"}});
  client::ConnectionSettings settings = settings_for_new_session();
  settings.token[0] ^= 1;
  EXPECT_THAT(failure(settings), AllOf(HasSubstr("hello"), HasSubstr("token")));
}

TEST_F(ConnectTest, TlsAgainstClearText) {
  start({.scenes = {"hall=gallery:0"}});
  client::ConnectionSettings settings = settings_for_new_session();
  settings.tls = trust(certificate_);
  EXPECT_THAT(failure(settings), AllOf(HasSubstr("TLS handshake"), HasSubstr("speak TLS")));
}

TEST_F(ConnectTest, ClearTextAgainstTls) {
  start(with_tls());
  client::ConnectionSettings settings = settings_for_new_session();
  EXPECT_THAT(failure(settings), AllOf(HasSubstr("hello"), HasSubstr("want TLS")));
}

TEST_F(ConnectTest, AnUntrustedCertificate) {
  start(with_tls());
  client::ConnectionSettings settings = settings_for_new_session();
  const Certificate other("localhost");
  settings.tls = trust(other);
  EXPECT_THAT(failure(settings), AllOf(HasSubstr("TLS handshake"), HasSubstr("certificate")));
}

TEST_F(ConnectTest, ACertificateOfAnotherName) {
  start(with_tls());
  client::ConnectionSettings settings = settings_for_new_session();
  settings.tls = *transport::TlsContext::client({certificate_.certificate_file(), "example.org"});
  EXPECT_THAT(failure(settings), HasSubstr("TLS handshake"));
}

TEST_F(ConnectTest, AServerThatNeverAnswers) {
  start({.scenes = {"hall=gallery:0"}});
  asio::io_context io;
  tcp::acceptor silent(io, test::loopback(0));
  client::ConnectionSettings settings = settings_for_new_session();
  settings.meta_port = silent.local_endpoint().port();
  settings.connect_timeout_ns = kNsPerSecond / 2;
  EXPECT_THAT(failure(settings), AllOf(HasSubstr("no answer to hello"), HasSubstr("0.5 s")));
}

// Passes bytes on between one TCP connection and a port of loopback.
class Relay {
 public:
  Relay(const char* address, uint16_t to)
      : acceptor_(io_, tcp::endpoint(asio::ip::make_address(address), 0)), in_(io_), out_(io_) {
    acceptor_.async_accept(in_, [this, to](auto error) {
      if (error) return;
      out_.connect(test::loopback(to));
      pass(in_, out_, buffers_[0]);
      pass(out_, in_, buffers_[1]);
    });
    thread_ = std::jthread([this] { io_.run(); });
  }
  ~Relay() { io_.stop(); }
  uint16_t port() const { return acceptor_.local_endpoint().port(); }

 private:
  using Buffer = std::array<char, 4096>;
  void pass(tcp::socket& from, tcp::socket& to, Buffer& buffer) {
    from.async_read_some(asio::buffer(buffer), [this, &from, &to, &buffer](auto error, size_t bytes) {
      transport::SystemError ignored;
      if (error) return void(to.shutdown(to.shutdown_send, ignored));
      asio::write(to, asio::buffer(buffer.data(), bytes), ignored);
      pass(from, to, buffer);
    });
  }

  asio::io_context io_;
  tcp::acceptor acceptor_;
  tcp::socket in_, out_;
  std::array<Buffer, 2> buffers_;
  std::jthread thread_;
};

// At the relay's address TCP gets through, and nothing answers by UDP: a firewall, or a wrong advertised
// address.
TEST_F(ConnectTest, BlockedUdp) {
  start({.scenes = {"hall=gallery:0"}});
  client::ConnectionSettings settings = settings_for_new_session();
  const Relay relay("127.0.0.2", settings.meta_port);
  settings.server_address = "127.0.0.2";
  settings.meta_port = relay.port();
  settings.connect_timeout_ns = kNsPerSecond;
  const std::string why = failure(settings);
  EXPECT_THAT(why, AllOf(HasSubstr("UDP"), HasSubstr("127.0.0.2:" + std::to_string(daemon_->media_port())),
                         HasSubstr("firewall")));
}

}  // namespace
}  // namespace tessera::server
