#include "transport/messages.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "base/utf8.h"
#include "transport/byte_io.h"

namespace tessera::transport {
namespace {

using Bytes = std::vector<uint8_t>;

constexpr uint16_t kMaxSide = 16384;
constexpr float kMaxTangent = 60;
constexpr uint8_t kNoSrtp = 0, kSrtpAes128Sha1 = 1;

// In this order.
constexpr TimeNs ClientFrameTimes::*kTimesOnTheWire[] = {
    &ClientFrameTimes::atlas_first_packet, &ClientFrameTimes::atlas_complete,
    &ClientFrameTimes::atlas_decode_begin, &ClientFrameTimes::atlas_decoded,
    &ClientFrameTimes::meta_complete,      &ClientFrameTimes::meta_decode_begin,
    &ClientFrameTimes::meta_decoded,       &ClientFrameTimes::draw_begin,
    &ClientFrameTimes::displayed,          &ClientFrameTimes::clock_offset,
    &ClientFrameTimes::clock_error};

Status malformed(const char* what) {
  return absl::InvalidArgumentError(
      absl::StrCat(what, " message: wrong length, a value out of range, or a text that is not UTF-8"));
}

Status other_version(const char* what, uint16_t version) {
  return absl::UnimplementedError(absl::StrCat(what, " of protocol version ", version,
                                               "; this end speaks version ", kProtocolVersion,
                                               ": update the older end"));
}

void write_text(ByteWriter& w, std::string_view text, size_t limit) {
  text = utf8_prefix(text.substr(0, limit));
  w.u16(static_cast<uint16_t>(text.size()));
  w.bytes({reinterpret_cast<const uint8_t*>(text.data()), text.size()});
}

std::string read_text(ByteReader& in, size_t limit) {
  const size_t length = in.u16();
  if (length > limit) in.fail();
  const auto bytes = in.bytes(length);
  std::string text(bytes.begin(), bytes.end());
  if (utf8_prefix(text).size() != text.size()) in.fail();
  return text;
}

template <size_t N>
void read_array(ByteReader& in, std::array<uint8_t, N>& out) {
  std::ranges::copy(in.bytes(N), out.begin());
}

void require(ByteReader& in, bool condition) {
  if (!condition) in.fail();
}

bool in_range(const Eye& eye) {
  const auto tangent = [](float t) { return t >= -kMaxTangent && t <= kMaxTangent; };
  const auto offset = [](double m) { return std::abs(m) <= kMaxEyeOffsetM; };
  const dvec3& at = eye.in_head.position;
  const Fov& fov = eye.fov;
  return offset(at.x) && offset(at.y) && offset(at.z) && tangent(fov.left) && tangent(fov.right) &&
         tangent(fov.down) && tangent(fov.up) && fov.left < fov.right && fov.down < fov.up;
}

bool in_range(const ClientSettings& c) {
  return c.width >= 1 && c.width <= kMaxSide && c.height >= 1 && c.height <= kMaxSide &&
         std::ranges::all_of(c.eyes, [](const Eye& eye) { return in_range(eye); }) && c.display_hz >= 1 &&
         c.display_hz <= 1000;
}

void write_eyes(std::span<const Eye> eyes, ByteWriter& w) {
  w.u8(static_cast<uint8_t>(eyes.size()));
  for (const Eye& eye : eyes) {
    for (int axis = 0; axis < 3; ++axis) w.f32(static_cast<float>(eye.in_head.position[axis]));
    write_orientation(eye.in_head.orientation, w);
    for (const float tangent : {eye.fov.left, eye.fov.right, eye.fov.down, eye.fov.up}) w.f32(tangent);
  }
}

std::vector<Eye> read_eyes(ByteReader& in) {
  const size_t count = in.u8();
  require(in, count >= 1 && count <= kMaxEyes);
  std::vector<Eye> eyes(in.ok() ? count : 0);
  for (Eye& eye : eyes) {
    for (int axis = 0; axis < 3; ++axis) eye.in_head.position[axis] = in.f32();
    eye.in_head.orientation = read_orientation(in);
    for (float* tangent : {&eye.fov.left, &eye.fov.right, &eye.fov.down, &eye.fov.up}) *tangent = in.f32();
  }
  return eyes;
}

template <class T>
StatusOr<T> finished(ByteReader& in, T message, const char* what) {
  if (!in.done()) return malformed(what);
  return message;
}

}  // namespace

Bytes encode(const Hello& m) {
  Bytes out;
  ByteWriter w(out);
  w.u16(m.version);
  w.bytes(m.token);
  w.u16(m.client.width);
  w.u16(m.client.height);
  write_eyes(m.client.eyes, w);
  w.f32(m.client.display_hz);
  write_text(w, m.client.name, kMaxNameBytes);
  return out;
}

StatusOr<Hello> decode_hello(std::span<const uint8_t> payload) {
  ByteReader in(payload);
  Hello m;
  m.version = in.u16();
  if (in.ok() && m.version != kProtocolVersion) return other_version("hello", m.version);
  read_array(in, m.token);
  m.client.width = in.u16();
  m.client.height = in.u16();
  m.client.eyes = read_eyes(in);
  m.client.display_hz = in.f32();
  m.client.name = read_text(in, kMaxNameBytes);
  require(in, in_range(m.client));
  return finished(in, std::move(m), "hello");
}

Bytes encode(const Welcome& m) {
  Bytes out;
  ByteWriter w(out);
  w.u16(m.version);
  w.u64(m.session);
  w.u16(m.media_port);
  w.u32(m.stream.ssrc);
  w.u32(m.stream.rtx_ssrc);
  w.u8(m.stream.payload_type);
  w.u8(m.stream.rtx_payload_type);
  w.u16(m.stream.first_sequence);
  w.u16(m.atlas_width);
  w.u16(m.atlas_height);
  w.u8(static_cast<uint8_t>(m.codec));
  w.f32(m.frames_per_second);
  w.u8(m.srtp ? kSrtpAes128Sha1 : kNoSrtp);
  if (m.srtp) {
    w.bytes(m.srtp->server);
    w.bytes(m.srtp->client);
  }
  return out;
}

StatusOr<Welcome> decode_welcome(std::span<const uint8_t> payload) {
  ByteReader in(payload);
  Welcome m;
  m.version = in.u16();
  if (in.ok() && m.version != kProtocolVersion) return other_version("welcome", m.version);
  m.session = in.u64();
  m.media_port = in.u16();
  m.stream.ssrc = in.u32();
  m.stream.rtx_ssrc = in.u32();
  m.stream.payload_type = in.u8();
  m.stream.rtx_payload_type = in.u8();
  m.stream.first_sequence = in.u16();
  m.atlas_width = in.u16();
  m.atlas_height = in.u16();
  const std::optional<AtlasCodec> codec = atlas_codec_from(in.u8());
  m.codec = codec.value_or(AtlasCodec::h264);
  m.frames_per_second = in.f32();
  const uint8_t srtp = in.u8();
  if (srtp == kSrtpAes128Sha1) {
    read_array(in, m.srtp.emplace().server);
    read_array(in, m.srtp->client);
  }
  require(in, codec && srtp <= kSrtpAes128Sha1 && m.stream.payload_type < 128 &&
                  m.stream.rtx_payload_type < 128 && m.frames_per_second > 0 && m.frames_per_second <= 1000);
  return finished(in, m, "welcome");
}

Bytes encode(const SequencedPose& m) {
  Bytes out;
  ByteWriter w(out);
  write_pose(m, w);
  return out;
}

StatusOr<SequencedPose> decode_pose(std::span<const uint8_t> payload) {
  ByteReader in(payload);
  const SequencedPose pose = read_pose(in);
  return finished(in, pose, "pose");
}

Bytes encode(std::span<const ClientFrameTimes> timings) {
  timings = timings.first(std::min(timings.size(), kMaxTimings));
  Bytes out;
  ByteWriter w(out);
  w.u16(static_cast<uint16_t>(timings.size()));
  for (const ClientFrameTimes& t : timings) {
    w.u32(t.frame);
    for (const auto time : kTimesOnTheWire) w.i64(t.*time);
  }
  return out;
}
StatusOr<std::vector<ClientFrameTimes>> decode_timings(std::span<const uint8_t> payload) {
  ByteReader in(payload);
  const size_t count = in.u16();
  require(in, count <= kMaxTimings);
  std::vector<ClientFrameTimes> timings(in.ok() ? count : 0);
  for (ClientFrameTimes& t : timings) {
    t.frame = in.u32();
    for (const auto time : kTimesOnTheWire) {
      t.*time = in.i64();
      require(in, is_sane(t.*time));
    }
  }
  return finished(in, std::move(timings), "timing");
}

Bytes encode(const ClockPing& m) {
  Bytes out;
  ByteWriter w(out);
  w.u32(m.id);
  w.i64(m.client_sent);
  return out;
}

StatusOr<ClockPing> decode_ping(std::span<const uint8_t> payload) {
  ByteReader in(payload);
  ClockPing m;
  m.id = in.u32();
  m.client_sent = in.i64();
  return finished(in, m, "ping");
}

Bytes encode(const ClockPong& m) {
  Bytes out;
  ByteWriter w(out);
  w.u32(m.id);
  w.i64(m.client_sent);
  w.i64(m.server_received);
  w.i64(m.server_sent);
  return out;
}

StatusOr<ClockPong> decode_pong(std::span<const uint8_t> payload) {
  ByteReader in(payload);
  ClockPong m;
  m.id = in.u32();
  m.client_sent = in.i64();
  m.server_received = in.i64();
  m.server_sent = in.i64();
  require(in, is_sane(m.client_sent) && is_sane(m.server_received) && is_sane(m.server_sent));
  return finished(in, m, "pong");
}

Bytes encode(const ErrorMessage& m) {
  Bytes out;
  ByteWriter w(out);
  w.u16(static_cast<uint16_t>(m.code));
  write_text(w, m.text, kMaxReasonBytes);
  return out;
}

StatusOr<ErrorMessage> decode_error(std::span<const uint8_t> payload) {
  ByteReader in(payload);
  ErrorMessage m;
  m.code = static_cast<ErrorCode>(in.u16());
  m.text = read_text(in, kMaxReasonBytes);
  return finished(in, std::move(m), "error");
}

Bytes encode(const ByeMessage& m) {
  Bytes out;
  ByteWriter w(out);
  write_text(w, m.reason, kMaxReasonBytes);
  return out;
}

StatusOr<ByeMessage> decode_bye(std::span<const uint8_t> payload) {
  ByteReader in(payload);
  ByeMessage m;
  m.reason = read_text(in, kMaxReasonBytes);
  return finished(in, std::move(m), "bye");
}

}  // namespace tessera::transport
