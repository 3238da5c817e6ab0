// The payloads of TCP frames (frame_io.h): fixed layouts, big-endian (docs/protocol.md). Parsers are safe for
// untrusted input: another length, a text that is too long or no UTF-8, or a value out of range is
// InvalidArgument.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/atlas_codec.h"
#include "base/frame_number.h"
#include "base/frame_record.h"
#include "base/status.h"
#include "base/view.h"
#include "transport/rtp_sender.h"
#include "transport/session_token.h"
#include "transport/wire_pose.h"

namespace tessera::transport {

constexpr uint16_t kProtocolVersion = 1;
constexpr size_t kMaxEyes = 2;
constexpr double kMaxEyeOffsetM = 1;  // from the head, along each axis
constexpr size_t kMaxNameBytes = 64, kMaxReasonBytes = 1024;

// What the client draws.
struct ClientSettings {
  uint16_t width = 0, height = 0;  // pixels of one eye, 1..16384
  std::vector<Eye> eyes{1};        // 1..kMaxEyes; tangents within ±60, left < right, down < up
  float display_hz = 0;            // 1..1000
  std::string name;                // of program and device, for logs; up to kMaxNameBytes
};

struct Hello {
  uint16_t version = kProtocolVersion;
  SessionToken token{};
  ClientSettings client;
};

constexpr size_t kSrtpKeyBytes = 30;  // AES-128 master key and 14 bytes of salt (RFC 3711)
using SrtpKey = std::array<uint8_t, kSrtpKeyBytes>;
struct SrtpKeys {
  SrtpKey server{}, client{};  // of what each sends
  bool operator==(const SrtpKeys&) const = default;
};

struct Welcome {
  uint16_t version = kProtocolVersion;  // of the server
  uint64_t session = 0;
  uint16_t media_port = 0;  // UDP, at the server's address
  StreamIds stream;
  uint16_t atlas_width = 0, atlas_height = 0;  // pixels
  AtlasCodec codec = AtlasCodec::h264;
  float frames_per_second = 0;   // of the server
  std::optional<SrtpKeys> srtp;  // only over TLS
};

constexpr size_t kMaxTimings = 256;  // in one message

struct ClockPing {
  uint32_t id = 0;
  TimeNs client_sent = 0;  // client's clock
  bool operator==(const ClockPing&) const = default;
};
struct ClockPong {
  uint32_t id = 0;
  TimeNs client_sent = 0;
  TimeNs server_received = 0, server_sent = 0;  // server's clock
  bool operator==(const ClockPong&) const = default;
};

enum class ErrorCode : uint16_t {
  internal = 0,
  bad_token = 1,
  unsupported_version = 2,
  malformed = 3,
  too_slow = 4,  // the peer did not take its data
  full = 5,      // no room for another session or connection
  busy = 6,      // the session has a client already
};
struct ErrorMessage {
  ErrorCode code = ErrorCode::internal;
  std::string text;  // up to kMaxReasonBytes; says what to do
};
struct ByeMessage {
  std::string reason;  // up to kMaxReasonBytes
};

// Texts that are too long are cut behind a character, and where they stop being UTF-8.
std::vector<uint8_t> encode(const Hello& m);
std::vector<uint8_t> encode(const Welcome& m);
std::vector<uint8_t> encode(const SequencedPose& m);
std::vector<uint8_t> encode(std::span<const ClientFrameTimes> timings);  // the first kMaxTimings
std::vector<uint8_t> encode(const ClockPing& m);
std::vector<uint8_t> encode(const ClockPong& m);
std::vector<uint8_t> encode(const ErrorMessage& m);
std::vector<uint8_t> encode(const ByeMessage& m);

// A hello or welcome of another version is Unimplemented, with both versions named; its token is not looked
// at.
StatusOr<Hello> decode_hello(std::span<const uint8_t> payload);
StatusOr<Welcome> decode_welcome(std::span<const uint8_t> payload);
StatusOr<SequencedPose> decode_pose(std::span<const uint8_t> payload);
StatusOr<std::vector<ClientFrameTimes>> decode_timings(std::span<const uint8_t> payload);
StatusOr<ClockPing> decode_ping(std::span<const uint8_t> payload);
StatusOr<ClockPong> decode_pong(std::span<const uint8_t> payload);
StatusOr<ErrorMessage> decode_error(std::span<const uint8_t> payload);
StatusOr<ByeMessage> decode_bye(std::span<const uint8_t> payload);

}  // namespace tessera::transport
