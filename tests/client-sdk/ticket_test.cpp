#include "client-sdk/ticket.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/time.h"

namespace tessera::client {
namespace {

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

}  // namespace
}  // namespace tessera::client
