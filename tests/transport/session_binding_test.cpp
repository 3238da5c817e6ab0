#include "transport/session_binding.h"

#include <gtest/gtest.h>

#include <random>

#include "test_streams.h"

namespace tessera::transport {
namespace {

using test::Bytes;
using test::from_hex;

SessionToken token(uint8_t v) {
  SessionToken t;
  t.fill(v);
  return t;
}
PeerAddress address(uint16_t port) {
  return {{1, 2, 3}, port};
}
Datagram hello(uint8_t v) {
  return write_hello({.token = token(v), .nonce = v});
}
const Bytes kRtcp = from_hex("80c90001 00000002"), kRtp = from_hex("8060 0001");

class Binding : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(binding.add(1, token(1)).ok());
    ASSERT_TRUE(binding.add(2, token(2)).ok());
  }
  SessionBinding binding;
};

TEST_F(Binding, AnAddressIsUnknownUntilItsHello) {
  EXPECT_FALSE(binding.route(address(10), kRtcp).session);
  EXPECT_EQ(binding.stats().unknown_address, 1u);
  const RoutedDatagram routed = binding.route(address(10), hello(1));
  EXPECT_EQ(routed.session, 1u);
  EXPECT_TRUE(routed.address_changed);
  EXPECT_EQ(parse_hello_answer(routed.answer)->nonce, 1u);
  EXPECT_EQ(binding.address_of(1), address(10));
  EXPECT_EQ(binding.route(address(10), kRtcp).session, 1u);
  EXPECT_EQ(binding.route(address(10), kRtcp).kind, DatagramKind::rtcp);
  EXPECT_EQ(binding.route(address(10), kRtp).kind, DatagramKind::rtp);
  EXPECT_FALSE(binding.route(address(11), kRtcp).session);
}

TEST_F(Binding, AWrongTokenGetsNoAnswer) {
  for (size_t byte = 0; byte < 16; ++byte) {
    SessionToken almost = token(1);
    almost[byte] ^= 1;
    const RoutedDatagram routed = binding.route(address(10), write_hello({.token = almost}));
    EXPECT_FALSE(routed.session);
    EXPECT_TRUE(routed.answer.empty());
  }
  EXPECT_EQ(binding.stats().bad_token, 16u);
}

TEST_F(Binding, ANewAddressOfTheClientReplacesTheOld) {
  binding.route(address(10), hello(1));
  EXPECT_FALSE(binding.route(address(10), hello(1)).address_changed);
  EXPECT_TRUE(binding.route(address(20), hello(1)).address_changed);
  EXPECT_EQ(binding.stats().rebound, 1u);
  EXPECT_FALSE(binding.route(address(10), kRtcp).session);
  EXPECT_EQ(binding.route(address(20), kRtcp).session, 1u);
}

TEST_F(Binding, AnAddressThatChangesItsSessionLeavesTheOldOne) {
  binding.route(address(10), hello(1));
  binding.route(address(10), hello(2));
  EXPECT_EQ(binding.route(address(10), kRtcp).session, 2u);
  EXPECT_FALSE(binding.address_of(1));
}

TEST_F(Binding, RemovedSessionsAreGone) {
  binding.route(address(10), hello(1));
  binding.remove(1);
  EXPECT_FALSE(binding.route(address(10), kRtcp).session);
  EXPECT_FALSE(binding.route(address(10), hello(1)).session);
  EXPECT_TRUE(binding.add(1, token(1)).ok());
}

TEST_F(Binding, IdsAndTokensAreUnique) {
  EXPECT_EQ(binding.add(1, token(9)).code(), absl::StatusCode::kAlreadyExists);
  EXPECT_EQ(binding.add(9, token(2)).code(), absl::StatusCode::kAlreadyExists);
}

TEST_F(Binding, AnotherVersionIsToldSo) {
  HelloDatagram newer{.version = 9, .token = token(1), .nonce = 5};
  Datagram datagram = write_hello(newer);
  datagram.push_back(7);  // newer versions may be longer
  const RoutedDatagram routed = binding.route(address(10), datagram);
  EXPECT_FALSE(routed.session);
  const auto answer = parse_hello_answer(routed.answer);
  ASSERT_TRUE(answer.ok());
  EXPECT_EQ(answer->status, HelloStatus::unsupported_version);
  EXPECT_EQ(answer->version, kDatagramVersion);
}

TEST_F(Binding, NonsenseIsCounted) {
  for (const Bytes& bad :
       {Bytes{}, Bytes{4}, Bytes{4, 1, 0}, Bytes{0, 1, 2}, Bytes{200, 1}, write_hello_answer({})})
    EXPECT_FALSE(binding.route(address(10), bad).session);
  EXPECT_EQ(binding.stats().malformed, 6u);
}

// A model of who is where, against random hellos, removals and data.
TEST(SessionBinding, AgreesWithASimpleModel) {
  std::mt19937 random(3);
  SessionBinding binding;
  std::map<SessionId, std::optional<uint16_t>> model;
  for (int i = 0; i < 20'000; ++i) {
    const auto session = static_cast<SessionId>(random() % 6);
    const auto port = static_cast<uint16_t>(random() % 8);
    switch (random() % 8) {
      case 0:
        if (binding.add(session, token(static_cast<uint8_t>(session))).ok()) model[session] = std::nullopt;
        break;
      case 1:
        binding.remove(session);
        model.erase(session);
        break;
      case 2:
        if (binding.route(address(port), hello(static_cast<uint8_t>(session))).session) {
          for (auto& [other, at] : model) {
            if (at == port) at.reset();
          }
          model.at(session) = port;
        }
        break;
      default:
        std::optional<SessionId> expected;
        for (const auto& [other, at] : model) {
          if (at == port) expected = other;
        }
        ASSERT_EQ(binding.route(address(port), kRtcp).session, expected);
    }
    ASSERT_EQ(binding.sessions(), model.size());
  }
}

TEST(LogLimiter, CountsWhatItHeldBack) {
  LogLimiter limiter(kNsPerSecond);
  EXPECT_EQ(limiter.event(0), 1u);
  for (int i = 1; i < 1000; ++i) EXPECT_FALSE(limiter.event(i * kNsPerMs));
  EXPECT_EQ(limiter.event(kNsPerSecond), 1000u);
}

}  // namespace
}  // namespace tessera::transport
