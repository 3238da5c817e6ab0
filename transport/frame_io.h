// Frames on the TCP connection: u32 length of the payload, u8 type, payload (docs/protocol.md). Safe for
// untrusted input.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "base/status.h"

namespace tessera::transport {

enum class FrameType : uint8_t {
  hello = 1,    // client → server, first
  welcome = 2,  // server → client, the answer
  meta = 3,     // server → client: a meta packet (docs/meta-format.md)
  pose = 4,     // client → server
  timing = 5,   // client → server: when what happened to its frames
  ping = 6,     // client → server: clock synchronisation
  pong = 7,     // server → client
  error = 8,    // either way; the sender closes the connection
  bye = 9,      // either way; likewise
};

constexpr size_t kFrameHeaderBytes = 5;
constexpr size_t kDefaultMaxFramePayload = 16u << 20;

// Appends one frame. InvalidArgument: the payload is longer than `max_payload`; nothing is appended.
Status write_frame(FrameType type, std::span<const uint8_t> payload, std::vector<uint8_t>& out,
                   size_t max_payload = kDefaultMaxFramePayload);

// Takes a byte stream in pieces of any size. Memory: one frame, and never more than has arrived plus one
// doubling.
class FrameParser {
 public:
  explicit FrameParser(size_t max_payload = kDefaultMaxFramePayload) : max_payload_(max_payload) {}

  // Called once for each complete frame; the payload lives as long as the call. An error ends the stream.
  using Handler = std::function<Status(FrameType, std::span<const uint8_t>)>;

  // InvalidArgument: a type that does not exist, or a length above the limit (the message names both); the
  // handler's error is passed on. After an error every call returns it again.
  Status feed(std::span<const uint8_t> bytes, const Handler& handler);

  // For frames from now on, e.g. a small one until the peer has shown its token.
  void set_max_payload(size_t max_payload) { max_payload_ = max_payload; }
  size_t buffered_bytes() const { return header_bytes_ + payload_.size(); }

 private:
  Status feed_frame(std::span<const uint8_t>& bytes, const Handler& handler);
  Status check_header() const;

  size_t max_payload_;
  std::array<uint8_t, kFrameHeaderBytes> header_{};
  size_t header_bytes_ = 0;
  std::vector<uint8_t> payload_;
  Status status_;
};

}  // namespace tessera::transport
