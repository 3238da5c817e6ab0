#include "transport/datagram.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "test_streams.h"

namespace tessera::transport {
namespace {

using test::Bytes;
using test::from_hex;

SequencedPose some_pose() {
  SequencedPose pose{0x01020304, {1'500'000'000, {{1.5, -2.0, 0.25}, {1, 0, 0, 0}}}, 1'500'000'001};
  pose.timed.pose.orientation = dquat(0.5, 0.5, -0.5, 0.5);  // w, x, y, z
  return pose;
}

// The vectors of docs/protocol.md.
constexpr const char* kHello = "04010000 000102030405060708090a0b0c0d0e0f 1122334455667788";
constexpr const char* kAnswer = "05010000 1122334455667788";
constexpr const char* kPose =
    "06010000 01020304 0000000059682f00 0000000059682f01 3ff8000000000000 c000000000000000 3fd0000000000000"
    "3f000000 bf000000 3f000000 3f000000 00";
constexpr const char* kLookingPose =
    "06010000 01020304 0000000059682f00 0000000059682f01 3ff8000000000000 c000000000000000 3fd0000000000000"
    "3f000000 bf000000 3f000000 3f000000 01 3f800000 00000000 00000000";

SessionToken counting_token() {
  SessionToken token;
  for (size_t i = 0; i < token.size(); ++i) token[i] = static_cast<uint8_t>(i);
  return token;
}

TEST(Datagram, KnownBytesBothWays) {
  const HelloDatagram hello{.token = counting_token(), .nonce = 0x1122334455667788};
  EXPECT_EQ(write_hello(hello), from_hex(kHello));
  EXPECT_EQ(*parse_hello(from_hex(kHello)), hello);
  const HelloAnswer answer{.nonce = 0x1122334455667788};
  EXPECT_EQ(write_hello_answer(answer), from_hex(kAnswer));
  EXPECT_EQ(*parse_hello_answer(from_hex(kAnswer)), answer);
  EXPECT_EQ(write_pose_datagram(some_pose()), from_hex(kPose));
  const auto pose = parse_pose_datagram(from_hex(kPose));
  ASSERT_TRUE(pose.ok()) << pose.status();
  EXPECT_EQ(pose->sequence, some_pose().sequence);
  EXPECT_EQ(pose->timed.time_ns, some_pose().timed.time_ns);
  EXPECT_EQ(pose->sent_ns, some_pose().sent_ns);
  EXPECT_TRUE(pose->timed.pose == some_pose().timed.pose);
  EXPECT_FALSE(pose->gaze.has_value());

  SequencedPose looking = some_pose();
  looking.gaze = vec3(1, 0, 0);
  EXPECT_EQ(write_pose_datagram(looking), from_hex(kLookingPose));
  const auto looks = parse_pose_datagram(from_hex(kLookingPose));
  ASSERT_TRUE(looks.ok()) << looks.status();
  EXPECT_TRUE(looks->timed.pose == some_pose().timed.pose);
  EXPECT_EQ(looks->gaze, looking.gaze);
}

TEST(Datagram, AnAnswerIsSmallerThanItsHello) {
  EXPECT_LT(write_hello_answer({}).size(), write_hello({}).size());
}

TEST(Datagram, EveryTruncationAndEveryExtraByteIsAnError) {
  for (const char* hex : {kHello, kAnswer, kPose, kLookingPose}) {
    const Bytes whole = from_hex(hex);
    for (size_t n = 0; n < whole.size() + 4; ++n) {
      Bytes bytes = whole;
      bytes.resize(n);
      const bool good = n == whole.size();
      EXPECT_EQ(parse_hello(bytes).ok(), good && hex == kHello) << n;
      EXPECT_EQ(parse_hello_answer(bytes).ok(), good && hex == kAnswer) << n;
      EXPECT_EQ(parse_pose_datagram(bytes).ok(), good && (hex == kPose || hex == kLookingPose)) << n;
    }
  }
}

TEST(Datagram, KindsByTheirFirstBytes) {
  EXPECT_EQ(classify(from_hex(kHello)), DatagramKind::hello);
  EXPECT_EQ(classify(from_hex(kAnswer)), DatagramKind::hello_answer);
  EXPECT_EQ(classify(from_hex(kPose)), DatagramKind::pose);
  EXPECT_EQ(classify(from_hex("80 60")), DatagramKind::rtp);
  EXPECT_EQ(classify(from_hex("80 e1")), DatagramKind::rtp);  // 225: type 97 with marker
  EXPECT_EQ(classify(from_hex("81 c8")), DatagramKind::rtcp);
  EXPECT_EQ(classify(from_hex("81 ce")), DatagramKind::rtcp);
  for (int first = 0; first < 256; ++first) {
    const bool ours = first >= 4 && first <= 6, rtp = first >= 128 && first <= 191;
    EXPECT_EQ(classify(Bytes{static_cast<uint8_t>(first), 0}) == DatagramKind::unknown, !ours && !rtp)
        << first;
  }
  EXPECT_EQ(classify({}), DatagramKind::unknown);
}

TEST(Datagram, PosesOutsideTheirRangeAreRefused) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  for (double bad : {nan, inf, -inf, 1.1e9}) {
    for (int axis = 0; axis < 3; ++axis) {
      SequencedPose pose = some_pose();
      pose.timed.pose.position[axis] = bad;
      EXPECT_FALSE(parse_pose_datagram(write_pose_datagram(pose)).ok()) << bad;
    }
  }
  for (const dquat& bad : {dquat(0, 0, 0, 0), dquat(nan, 0, 0, 0), dquat(1, inf, 0, 0), dquat(0.4, 0, 0, 0),
                           dquat(3, 0, 0, 0)}) {
    SequencedPose pose = some_pose();
    pose.timed.pose.orientation = bad;
    EXPECT_FALSE(parse_pose_datagram(write_pose_datagram(pose)).ok());
  }
  SequencedPose scaled = some_pose();
  scaled.timed.pose.orientation = dquat(0, 1.5, 0, 0);
  EXPECT_NEAR(glm::length(parse_pose_datagram(write_pose_datagram(scaled))->timed.pose.orientation), 1,
              1e-12);
}

TEST(Datagram, GazesOutsideTheirRangeAreRefused) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  for (const vec3& bad : {vec3(0), vec3(nan, 0, 0), vec3(0, nan, 1), vec3(0, 0, inf), vec3(-inf, 0, 0),
                          vec3(0.4f, 0, 0), vec3(0, 2.1f, 0), vec3(1e30f, 1e30f, 0), vec3(1e-30f, 0, 0)}) {
    SequencedPose pose = some_pose();
    pose.gaze = bad;
    EXPECT_FALSE(parse_pose_datagram(write_pose_datagram(pose)).ok())
        << bad.x << " " << bad.y << " " << bad.z;
  }
  SequencedPose scaled = some_pose();
  scaled.gaze = vec3(0.6f, 0, -1.6f);
  EXPECT_NEAR(glm::length(*parse_pose_datagram(write_pose_datagram(scaled))->gaze), 1, 1e-6);
  Bytes other_kind = from_hex(kLookingPose);
  for (const uint8_t kind : {uint8_t{2}, uint8_t{255}}) {
    other_kind[64] = kind;  // where the gaze's kind stands
    EXPECT_FALSE(parse_pose_datagram(other_kind).ok());
  }
}

TEST(NewestPose, TakesOnlyWhatIsNewerThroughTheWrap) {
  NewestPose newest;
  EXPECT_TRUE(newest.accept(0xfffffffe));
  EXPECT_FALSE(newest.accept(0xfffffffe));
  EXPECT_TRUE(newest.accept(1));
  EXPECT_FALSE(newest.accept(0xffffffff));
  EXPECT_FALSE(newest.accept(0));
  EXPECT_TRUE(newest.accept(2));
}

}  // namespace
}  // namespace tessera::transport
