// One TCP (or TLS) connection that carries frames (frame_io.h), with a bounded queue of what the peer has not
// taken yet.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "base/status.h"
#include "base/time.h"
#include "transport/asio/asio.h"
#include "transport/asio/byte_stream.h"
#include "transport/frame_io.h"
#include "transport/messages.h"

namespace tessera::transport {

struct MetaConnectionSettings {
  size_t max_queued_bytes = 8u << 20;               // that wait for the peer; more closes the connection
  size_t max_payload = kDefaultMaxFramePayload;     // of a frame that comes in
  DurationNs stall_timeout_ns = 10 * kNsPerSecond;  // data waits and the peer takes none of it: closes
  DurationNs close_timeout_ns = 2 * kNsPerSecond;   // for what is queued when close() is called, in all
};

// Called on the stream's executor, never while the connection holds a lock.
struct MetaConnectionEvents {
  // An error closes the connection and is told to the peer.
  std::function<Status(FrameType, std::span<const uint8_t>)> on_frame;
  // Once, last. OK: either end said bye; Cancelled: the same, with a reason; else what went wrong.
  std::function<void(const Status&)> on_closed;
};

// Thread-safe. The stream's executor must be a strand. It lives until it is closed.
class MetaConnection : public std::enable_shared_from_this<MetaConnection> {
 public:
  // The stream's handshake is done.
  static std::shared_ptr<MetaConnection> start(std::unique_ptr<ByteStream> stream,
                                               const MetaConnectionSettings& settings,
                                               MetaConnectionEvents events);

  // Queues a frame; frames keep their order, and wait as long as the peer is slow.
  // DeadlineExceeded: the peer is too slow, the queue would exceed max_queued_bytes; the connection closes.
  // FailedPrecondition: it is closed.
  Status send(FrameType type, std::span<const uint8_t> payload);
  // Sends what is queued, then a bye (OK, or Cancelled with a reason) or an error frame, then closes.
  void close(Status reason);

  size_t queued_bytes() const;
  bool closed() const;
  // For frames from now on. Call from on_frame.
  void set_max_payload(size_t max_payload);

 private:
  MetaConnection(std::unique_ptr<ByteStream> stream, const MetaConnectionSettings& settings,
                 MetaConnectionEvents events);
  void read();
  void on_read(SystemError error, size_t bytes);
  Status on_frame(FrameType type, std::span<const uint8_t> payload);
  void enqueue(std::vector<uint8_t> frame);
  void write();
  void on_written(SystemError error, size_t bytes);
  void watch_stall();
  void finish(Status reason);
  void begin_close(Status reason);
  static std::vector<uint8_t> last_frame(const Status& reason);

  mutable std::mutex mutex_;  // of all below but the parser and the read buffer
  std::unique_ptr<ByteStream> stream_;
  asio::steady_timer stall_timer_;
  MetaConnectionSettings settings_;
  MetaConnectionEvents events_;
  FrameParser parser_;
  std::vector<uint8_t> read_buffer_;
  std::deque<std::vector<uint8_t>> queue_;  // the front is being written, from written_ on
  size_t written_ = 0, queued_bytes_ = 0;
  bool writing_ = false, closed_ = false;
  uint64_t progress_ = 0;          // counts writes that took bytes
  std::optional<Status> closing_;  // the reason, once the queue is empty
};

// For error frames and back.
ErrorCode error_code(const Status& status);
Status to_status(const ErrorMessage& message);

}  // namespace tessera::transport
