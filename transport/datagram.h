// What arrives at the media port: RTP and RTCP, and our own small datagrams beside them (docs/protocol.md).
// The first byte tells them apart, as RFC 7983 does. Parsers are safe for untrusted input.
#pragma once

#include <cstdint>
#include <span>

#include "base/status.h"
#include "transport/rtp_packet.h"
#include "transport/session_token.h"
#include "transport/wire_pose.h"

namespace tessera::transport {

constexpr uint8_t kDatagramVersion = 1;

enum class DatagramKind : uint8_t { hello, hello_answer, pose, rtp, rtcp, unknown };

// By the first two bytes: 4, 5, 6 are ours (RFC 7983 leaves 4..15 free), 128..191 are RTP, of which RTCP has
// a second byte of 192..223 (RFC 5761).
DatagramKind classify(std::span<const uint8_t> datagram);

// Binds the sender's address to the session of the token. Sent until answered, and again now and then, so
// that a new address of the client (NAT) is learnt and the round trip is measured.
struct HelloDatagram {
  uint8_t version = kDatagramVersion;
  SessionToken token{};
  uint64_t nonce = 0;  // comes back in the answer
  bool operator==(const HelloDatagram&) const = default;
};

enum class HelloStatus : uint8_t { bound = 0, unsupported_version = 1 };

// Smaller than the hello, so that nobody can use a server to amplify. A wrong token gets no answer.
struct HelloAnswer {
  uint8_t version = kDatagramVersion;  // of the server
  HelloStatus status = HelloStatus::bound;
  uint64_t nonce = 0;
  bool operator==(const HelloAnswer&) const = default;
};

Datagram write_hello(const HelloDatagram& hello);
Datagram write_hello_answer(const HelloAnswer& answer);
Datagram write_pose_datagram(const SequencedPose& pose);

// InvalidArgument: another kind, another length, or a value out of range. Hellos of other versions are read
// as far as all versions agree: version, token, nonce.
StatusOr<HelloDatagram> parse_hello(std::span<const uint8_t> datagram);
StatusOr<HelloAnswer> parse_hello_answer(std::span<const uint8_t> datagram);
StatusOr<SequencedPose> parse_pose_datagram(std::span<const uint8_t> datagram);

}  // namespace tessera::transport
