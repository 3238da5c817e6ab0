#include "transport/messages.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "test_streams.h"

namespace tessera::transport {
namespace {

using test::Bytes;
using test::from_hex;

Hello some_hello() {
  Hello m;
  m.token.fill(0xa5);
  m.client = {1920, 1080, {{.fov = {-1.25f, 1.5f, -0.75f, 1}}}, 72, "viewer"};
  return m;
}

// The right eye a little higher than the left one, and turned; all values are exact in f32.
Hello stereo_hello() {
  Hello m = some_hello();
  m.client.eyes.push_back({.fov = {-1.5f, 1.25f, -0.75f, 1}});
  m.client.eyes[0].in_head.position = {-1.0 / 32, 0, 0};
  m.client.eyes[1].in_head = {{1.0 / 32, 1.0 / 64, 0}, dquat(0.5, 0.5, 0.5, 0.5)};
  return m;
}

Welcome some_welcome() {
  Welcome m;
  m.session = 3;
  m.media_port = 5004;
  m.stream = {0x11111111, 0x22222222, 96, 97, 0x3333};
  m.atlas_width = 2048;
  m.atlas_height = 1024;
  m.codec = AtlasCodec::jpeg;
  m.frames_per_second = 30;
  return m;
}

// The vectors of docs/protocol.md.
constexpr const char* kHello =
    "0001 a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5 0780 0438 01 00000000 00000000 00000000 00000000 00000000 "
    "00000000 "
    "3f800000 bfa00000 3fc00000 bf400000 3f800000 42900000 0006 766965776572";
constexpr const char* kStereoHello =
    "0001 a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5 0780 0438 02 bd000000 00000000 00000000 00000000 00000000 "
    "00000000 "
    "3f800000 bfa00000 3fc00000 bf400000 3f800000 3d000000 3c800000 00000000 3f000000 3f000000 3f000000 "
    "3f000000 bfc00000 3fa00000 bf400000 3f800000 42900000 0006 766965776572";
constexpr const char* kWelcome =
    "0001 0000000000000003 138c 11111111 22222222 60 61 3333 0800 0400 01 41f00000 00";

TEST(Messages, KnownBytes) {
  EXPECT_EQ(encode(some_hello()), from_hex(kHello));
  EXPECT_EQ(encode(stereo_hello()), from_hex(kStereoHello));
  EXPECT_EQ(encode(some_welcome()), from_hex(kWelcome));
  EXPECT_EQ(encode(ClockPing{1, 2}), from_hex("00000001 0000000000000002"));
  EXPECT_EQ(encode(ClockPong{1, 2, 3, 4}),
            from_hex("00000001 0000000000000002 0000000000000003 0000000000000004"));
  EXPECT_EQ(encode(ErrorMessage{ErrorCode::bad_token, "abc"}), from_hex("0001 0003 616263"));
  EXPECT_EQ(encode(ByeMessage{"abc"}), from_hex("0003 616263"));
  const ClientFrameTimes timing{7, 1, 2, 3, 4, 5, 6, 7, 8, 9, -10, 11};
  EXPECT_EQ(encode(std::span(&timing, 1)),
            from_hex("0001 00000007 0000000000000001 0000000000000002 0000000000000003 0000000000000004"
                     "0000000000000005 0000000000000006 0000000000000007 0000000000000008 0000000000000009"
                     "fffffffffffffff6 000000000000000b"));
}

TEST(Messages, ComeBackAsTheyWere) {
  const auto hello = decode_hello(encode(some_hello()));
  ASSERT_TRUE(hello.ok()) << hello.status();
  EXPECT_EQ(hello->token, some_hello().token);
  EXPECT_EQ(hello->client.name, "viewer");
  EXPECT_EQ(hello->client.eyes[0].fov.right, 1.5f);
  EXPECT_EQ(hello->client.display_hz, 72);

  const auto stereo = decode_hello(encode(stereo_hello()));
  ASSERT_TRUE(stereo.ok()) << stereo.status();
  ASSERT_EQ(stereo->client.eyes.size(), 2u);
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(stereo->client.eyes[i].in_head, stereo_hello().client.eyes[i].in_head);
    EXPECT_EQ(stereo->client.eyes[i].fov.left, stereo_hello().client.eyes[i].fov.left);
  }

  Welcome with_keys = some_welcome();
  with_keys.srtp.emplace().server.fill(1);
  with_keys.srtp->client.fill(2);
  for (const Welcome& m : {some_welcome(), with_keys}) {
    const auto welcome = decode_welcome(encode(m));
    ASSERT_TRUE(welcome.ok()) << welcome.status();
    EXPECT_EQ(welcome->stream, m.stream);
    EXPECT_EQ(welcome->srtp, m.srtp);
    EXPECT_EQ(welcome->codec, AtlasCodec::jpeg);
    EXPECT_EQ(welcome->media_port, 5004);
  }
  const std::vector<ClientFrameTimes> timings = {{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12},
                                                 {13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24}};
  EXPECT_EQ(*decode_timings(encode(timings)), timings);
  EXPECT_EQ(*decode_ping(encode(ClockPing{9, -5})), (ClockPing{9, -5}));
  EXPECT_EQ(*decode_pong(encode(ClockPong{9, 1, 2, 3})), (ClockPong{9, 1, 2, 3}));
  EXPECT_EQ(decode_error(encode(ErrorMessage{ErrorCode::full, "x"}))->code, ErrorCode::full);
  EXPECT_EQ(decode_bye(encode(ByeMessage{"why"}))->reason, "why");
}

TEST(Messages, EveryTruncationAndEveryExtraByteIsAnError) {
  Welcome with_keys = some_welcome();
  with_keys.srtp.emplace();
  const std::vector<ClientFrameTimes> timings(3);
  const SequencedPose pose{1, {2, {}}}, looking{1, {2, {}}, 0, vec3(0, 0, -1)};
  const std::pair<Bytes, std::function<Status(const Bytes&)>> cases[] = {
      {encode(some_hello()), [](const Bytes& b) { return decode_hello(b).status(); }},
      {encode(stereo_hello()), [](const Bytes& b) { return decode_hello(b).status(); }},
      {encode(some_welcome()), [](const Bytes& b) { return decode_welcome(b).status(); }},
      {encode(with_keys), [](const Bytes& b) { return decode_welcome(b).status(); }},
      {encode(pose), [](const Bytes& b) { return decode_pose(b).status(); }},
      {encode(looking), [](const Bytes& b) { return decode_pose(b).status(); }},
      {encode(timings), [](const Bytes& b) { return decode_timings(b).status(); }},
      {encode(ClockPing{}), [](const Bytes& b) { return decode_ping(b).status(); }},
      {encode(ClockPong{}), [](const Bytes& b) { return decode_pong(b).status(); }},
      {encode(ErrorMessage{}), [](const Bytes& b) { return decode_error(b).status(); }},
      {encode(ByeMessage{"abc"}), [](const Bytes& b) { return decode_bye(b).status(); }},
  };
  for (const auto& [whole, decode] : cases) {
    for (size_t n = 0; n < whole.size() + 3; ++n) {
      Bytes bytes = whole;
      bytes.resize(n);
      EXPECT_EQ(decode(bytes).ok(), n == whole.size()) << n << " of " << whole.size();
    }
  }
}

TEST(Messages, ValuesOutsideTheirRangeAreRefused) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  using Change = void (*)(ClientSettings&);
  for (Change change : std::initializer_list<Change>{
           [](auto& c) { c.width = 0; }, [](auto& c) { c.height = 16385; },
           [](auto& c) { c.eyes[0].fov.left = 2; }, [](auto& c) { c.eyes[0].fov.up = -1; },
           [](auto& c) { c.eyes[0].fov.right = 61; }, [](auto& c) { c.display_hz = 0; },
           [](auto& c) { c.display_hz = 1001; }}) {
    Hello hello = some_hello();
    change(hello.client);
    EXPECT_EQ(decode_hello(encode(hello)).status().code(), absl::StatusCode::kInvalidArgument);
  }
  Hello hello = some_hello();
  hello.client.eyes[0].fov.left = nan;
  EXPECT_FALSE(decode_hello(encode(hello)).ok());
  hello = some_hello();
  hello.client.display_hz = nan;
  EXPECT_FALSE(decode_hello(encode(hello)).ok());
  Welcome welcome = some_welcome();
  welcome.frames_per_second = nan;
  EXPECT_FALSE(decode_welcome(encode(welcome)).ok());
  welcome = some_welcome();
  welcome.codec = static_cast<AtlasCodec>(3);
  EXPECT_FALSE(decode_welcome(encode(welcome)).ok());
  EXPECT_FALSE(decode_timings(from_hex("0101")).ok());
  for (const TimeNs far : {kMaxTimeNs + 1, -kMaxTimeNs - 1, std::numeric_limits<TimeNs>::min()}) {
    const ClientFrameTimes timing{.displayed = far};
    EXPECT_FALSE(decode_timings(encode(std::span(&timing, 1))).ok()) << far;
    EXPECT_FALSE(decode_pose(encode(SequencedPose{1, {far, {}}})).ok()) << far;
    EXPECT_FALSE(decode_pong(encode(ClockPong{1, 0, far, 0})).ok()) << far;
  }
  Bytes long_name = encode(some_hello());
  long_name.resize(long_name.size() - 8);
  long_name.insert(long_name.end(), {0, 65});
  long_name.resize(long_name.size() + 65, 'x');
  EXPECT_FALSE(decode_hello(long_name).ok());
}

TEST(Messages, EyesOutsideTheirRangeAreRefused) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  using Change = void (*)(Eye&);
  for (Change change : std::initializer_list<Change>{
           [](Eye& e) { e.fov.right = e.fov.left; }, [](Eye& e) { e.fov.down = -61; },
           [](Eye& e) { e.in_head.position.x = 1.01; }, [](Eye& e) { e.in_head.position.z = -1e30; },
           [](Eye& e) { e.in_head.orientation = dquat(0, 0, 0, 0); },
           [](Eye& e) { e.in_head.orientation = dquat(0, 0, 3, 0); }}) {
    for (size_t i = 0; i < 2; ++i) {
      Hello hello = stereo_hello();
      change(hello.client.eyes[i]);
      EXPECT_EQ(decode_hello(encode(hello)).status().code(), absl::StatusCode::kInvalidArgument);
    }
  }
  for (int axis = 0; axis < 3; ++axis) {
    Hello hello = stereo_hello();
    hello.client.eyes[1].in_head.position[axis] = nan;
    EXPECT_FALSE(decode_hello(encode(hello)).ok());
    hello = stereo_hello();
    hello.client.eyes[1].in_head.orientation[axis] = nan;
    EXPECT_FALSE(decode_hello(encode(hello)).ok());
  }
  Hello hello = some_hello();
  hello.client.eyes.clear();
  EXPECT_FALSE(decode_hello(encode(hello)).ok()) << "nobody looks";
  hello.client.eyes.resize(kMaxEyes + 1);
  EXPECT_FALSE(decode_hello(encode(hello)).ok());
}

TEST(Messages, OtherVersionsAreNamed) {
  Hello hello = some_hello();
  hello.version = 7;
  const Status status = decode_hello(encode(hello)).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kUnimplemented);
  EXPECT_NE(status.message().find("version 7"), std::string::npos) << status;
}

TEST(Messages, LongTextsAreCut) {
  EXPECT_EQ(decode_bye(encode(ByeMessage{std::string(5000, 'x')}))->reason.size(), kMaxReasonBytes);
  std::string text = "x";  // so that the limit falls amid a character
  for (int i = 0; i < 600; ++i) text += "ü";
  EXPECT_EQ(encode(ByeMessage{text}).size(), 2 + kMaxReasonBytes - 1);
  EXPECT_EQ(decode_bye(encode(ByeMessage{text}))->reason, text.substr(0, kMaxReasonBytes - 1));
}

TEST(Messages, TextsAreUtf8) {
  const auto is_read = [](const char* hex) {
    const Bytes text = from_hex(hex);
    Bytes bye{0, static_cast<uint8_t>(text.size())}, error{0, 1};
    bye.insert(bye.end(), text.begin(), text.end());
    error.insert(error.end(), bye.begin(), bye.end());
    EXPECT_EQ(decode_bye(bye).ok(), decode_error(error).ok());
    return decode_bye(bye).ok();
  };
  for (const char* good :
       {"", "00", "7f", "c280", "dfbf", "e0a080", "ed9fbf", "ee8080", "efbfbf", "f0908080", "f48fbfbf"})
    EXPECT_TRUE(is_read(good)) << good;
  for (const char* bad : {"ff",       "fe",       "80",         "bf",          "61ff62",
                          "c3",       "c328",     "e282",       "e28228",      "f09f98",  // cut
                          "c080",     "c1bf",     "e09fbf",     "f08fbfbf",       // longer than need be
                          "eda080",   "edbfbf",                                   // surrogates
                          "f4908080", "f5808080", "f888808080", "fc8480808080"})  // beyond U+10FFFF
    EXPECT_FALSE(is_read(bad)) << bad;
  Hello hello = some_hello();
  hello.client.name = "viewér";
  EXPECT_EQ(decode_hello(encode(hello))->client.name, "viewér");
  EXPECT_EQ(decode_bye(encode(ByeMessage{"cannot open caf\xe9.pem"}))->reason, "cannot open caf")
      << "what is no text ends where it stops being one";
}

}  // namespace
}  // namespace tessera::transport
