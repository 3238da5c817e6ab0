// The client's end of the media port: says hello until it is answered, receives the video, sends poses.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>

#include "base/status.h"
#include "base/time.h"
#include "transport/asio/asio.h"
#include "transport/asio/udp_socket.h"
#include "transport/datagram.h"
#include "transport/rtp_receiver.h"
#include "transport/session_token.h"
#include "transport/srtp.h"

namespace tessera::transport {

struct MediaClientSettings {
  std::string server_address = "127.0.0.1";
  uint16_t server_port = 0;
  std::string bind_address;  // empty: any, of the server's family
  SessionToken token{};
  RtpReceiverSettings receiver;
  std::optional<SrtpKeys> srtp;                     // of the welcome
  DurationNs hello_interval_ns = 200 * kNsPerMs;    // until the first answer
  DurationNs keep_alive_ns = 2 * kNsPerSecond;      // afterwards: measures the round trip, renews the binding
  DurationNs bind_timeout_ns = 8 * kNsPerSecond;    // without a first answer: on_failed
  DurationNs answer_timeout_ns = 8 * kNsPerSecond;  // without another one: likewise
};

// Called on the client's executor, one at a time, never while it holds a lock.
struct MediaClientEvents {
  std::function<void(DurationNs round_trip_ns)> on_bound;  // once
  std::function<void(ReceivedFrame)> on_frame;             // in decoding order
  std::function<void(Status)> on_failed;                   // once; the client is closed
};

// Thread-safe. Close it before its last owner lets go.
class MediaClient : public std::enable_shared_from_this<MediaClient> {
 public:
  static StatusOr<std::shared_ptr<MediaClient>> open(asio::any_io_executor executor,
                                                     const MediaClientSettings& settings, const Clock& clock,
                                                     MediaClientEvents events);
  // Says BYE if it is bound.
  void close(const std::string& reason = "client closes");

  // False: not sent, because the client is not bound yet, or because of SRTP; then poses go over the meta
  // connection.
  bool send_pose(const SequencedPose& pose);
  void request_key_frame();
  RtpReceiverStats stats() const;
  std::optional<DurationNs> round_trip_ns() const;  // of the last answered hello

 private:
  MediaClient(asio::any_io_executor executor, const MediaClientSettings& settings, const Clock& clock,
              MediaClientEvents events);
  void on_datagram(const PeerAddress& from, std::span<const uint8_t> datagram);
  std::function<void()> on_hello_answer(std::span<const uint8_t> datagram);
  void send_hello(TimeNs now);
  void on_media(std::span<const uint8_t> datagram, DatagramKind kind);
  void send_feedback(Datagram datagram);
  void step();
  void schedule();
  DurationNs patience_ns() const { return bound_ ? settings_.answer_timeout_ns : settings_.bind_timeout_ns; }
  void fail(Status status);

  const Clock& clock_;
  MediaClientSettings settings_;
  MediaClientEvents events_;
  PeerAddress server_;
  std::shared_ptr<UdpSocket> socket_;
  mutable std::mutex mutex_;  // of all below
  asio::steady_timer timer_;
  RtpReceiver receiver_;
  std::unique_ptr<Srtp> srtp_;  // empty: clear text
  bool bound_ = false, closed_ = false;
  uint64_t nonce_ = 0;
  TimeNs hello_sent_ns_ = 0, next_hello_ns_ = 0, last_answer_ns_ = 0;
  std::optional<DurationNs> round_trip_ns_;
};

}  // namespace tessera::transport
