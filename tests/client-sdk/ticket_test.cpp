#include "client-sdk/ticket.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>

#include "base/time.h"

namespace tessera::client {
namespace {

using boost::asio::ip::tcp;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kToken[] = "00112233445566778899aAbBcCdDeEfF";

std::string with_token(const std::string& before, const std::string& after = "") {
  return before + kToken + after;
}

TEST(Ticket, HasHostPortTokenAndAuthority) {
  const auto plain = parse_ticket(with_token("tessera://192.0.2.7:7311/"));
  ASSERT_TRUE(plain.ok()) << plain.status();
  EXPECT_EQ(plain->host, "192.0.2.7");
  EXPECT_EQ(plain->meta_port, 7311);
  EXPECT_EQ(plain->token[0], 0x00);
  EXPECT_EQ(plain->token[15], 0xff);
  EXPECT_FALSE(plain->authority_file.has_value());

  const auto tls = parse_ticket(with_token("tessera://render.example:1/", "?ca=/etc/my%20ca%26b.pem"));
  ASSERT_TRUE(tls.ok()) << tls.status();
  EXPECT_EQ(tls->host, "render.example");
  EXPECT_EQ(tls->authority_file, "/etc/my ca&b.pem");
  EXPECT_EQ(parse_ticket(with_token("tessera://[2001:db8::1]:7311/"))->host, "2001:db8::1");
  EXPECT_EQ(parse_ticket(with_token("tessera://a:65535/", "?ca="))->authority_file, "") << "the system's";
}

TEST(Ticket, TextIsTheInverseOfParsing) {
  for (const std::string host : {"127.0.0.1", "::1", "render.example"}) {
    for (const std::optional<std::string>& file :
         {std::optional<std::string>(), std::optional<std::string>(""),
          std::optional<std::string>("/x y/ü?&%.pem")}) {
      Ticket ticket{.host = host, .meta_port = 7311, .authority_file = file};
      for (size_t i = 0; i < ticket.token.size(); ++i) ticket.token[i] = static_cast<uint8_t>(17 * i + 3);
      const auto again = parse_ticket(to_string(ticket));
      ASSERT_TRUE(again.ok()) << again.status();
      EXPECT_EQ(*again, ticket) << to_string(ticket);
    }
  }
}

TEST(Ticket, WhatIsWrongIsNamedAndTheTokenIsNotShown) {
  const std::vector<std::pair<std::string, std::string>> cases{
      {"", "tessera://"},
      {with_token("https://a:1/"), "tessera://"},
      {"tessera://a:1", "/TOKEN"},
      {with_token("tessera://a/"), ":PORT"},
      {with_token("tessera://a:0/"), "1 to 65535"},
      {with_token("tessera://a:65536/"), "1 to 65535"},
      {with_token("tessera://a:-1/"), "1 to 65535"},
      {with_token("tessera://a:x/"), "1 to 65535"},
      {with_token("tessera://:1/"), "host"},
      {with_token("tessera://[::1:1/"), "brackets"},
      {with_token("tessera://::1:1/"), "brackets"},
      {with_token("tessera://user@a:1/"), "host"},
      {with_token("tessera://a:1/", "0"), "32 hexadecimal"},
      {with_token("tessera://a:1/0"), "32 hexadecimal"},
      {"tessera://a:1/0011223344556677889900aabbccddeg", "32 hexadecimal"},
      {with_token("tessera://a:1/", "?tls=1"), "ca=FILE"},
      {with_token("tessera://a:1/", "?ca=x&ca=y"), "ca=FILE"},
      {with_token("tessera://a:1/", "?ca=%4"), "%"},
      {with_token("tessera://a:1/", "?ca=%zz"), "%"},
      {with_token("tessera://a:1/", "?ca=a%00b"), "zero byte"}};
  for (const auto& [text, word] : cases) {
    const auto ticket = parse_ticket(text);
    ASSERT_FALSE(ticket.ok()) << text;
    EXPECT_EQ(ticket.status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(ticket.status().message()), HasSubstr(word)) << text;
    EXPECT_THAT(std::string(ticket.status().message()), Not(HasSubstr("00112233")));
  }
}

TEST(Ticket, ConnectingNamesTheStepThatFailed) {
  const SteadyClock clock;
  const transport::ClientSettings settings{.width = 16, .height = 16, .display_hz = 60};
  const auto failure = [&](const std::string& text) {
    return std::string(connect(*parse_ticket(text), settings, kNsPerSecond, clock).status().message());
  };
  EXPECT_THAT(failure(with_token("tessera://nowhere.invalid:1/")), HasSubstr("resolve `nowhere.invalid`"));
  EXPECT_THAT(failure(with_token("tessera://127.0.0.1:1/")), HasSubstr("127.0.0.1:1: connect: "));
  EXPECT_THAT(failure(with_token("tessera://127.0.0.1:1/", "?ca=/no/such.pem")), HasSubstr("/no/such.pem"));
}

// Answers no connect any more, as behind a firewall: its queue is full.
class Hole {
 public:
  explicit Hole(const char* address, uint16_t port = 0) {
    acceptor_.open(tcp::v4());
    acceptor_.bind({boost::asio::ip::make_address(address), port});
    acceptor_.listen(0);
    filler_.connect(acceptor_.local_endpoint());
  }
  uint16_t port() const { return acceptor_.local_endpoint().port(); }

 private:
  boost::asio::io_context io_;
  tcp::acceptor acceptor_{io_};
  tcp::socket filler_{io_};
};

TEST(Ticket, AnAddressThatSwallowsConnectsLeavesTimeForTheNext) {
  const SteadyClock clock;
  const Hole hole("127.0.0.2");
  ConnectionSettings settings{.meta_port = hole.port(), .connect_timeout_ns = kNsPerSecond};
  settings.client = {.width = 16, .height = 16, .display_hz = 60};
  const auto failure = [&](const std::vector<std::string>& addresses) {
    return connect_to_first(addresses, settings, clock).status();
  };
  const Status refused = failure({"127.0.0.2", "127.0.0.3"});
  EXPECT_TRUE(absl::IsUnavailable(refused)) << refused;
  EXPECT_THAT(std::string(refused.message()), HasSubstr("TCP 127.0.0.3:"));
  EXPECT_THAT(std::string(refused.message()), HasSubstr("connect: "));

  const Hole next("127.0.0.3", hole.port());
  const Status silence = failure({"127.0.0.2", "127.0.0.3"});
  EXPECT_THAT(std::string(silence.message()), HasSubstr("TCP 127.0.0.3:"));
  EXPECT_THAT(std::string(silence.message()), HasSubstr("no answer to connect for 0."))
      << "not a second each";
}

}  // namespace
}  // namespace tessera::client
