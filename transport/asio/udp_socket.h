// A UDP socket that never blocks: sends at once, or queues up to a limit while the system's buffer is full.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <span>

#include "base/status.h"
#include "transport/asio/asio.h"
#include "transport/rtp_packet.h"
#include "transport/session_binding.h"

namespace tessera::transport {

struct UdpSocketSettings {
  std::string address = "127.0.0.1";  // to bind
  uint16_t port = 0;                  // 0: a free one
  int socket_buffer_bytes = 4 << 20;  // asked of the system, each way
  size_t max_queued_datagrams = 1024;
};

// Thread-safe. The handler runs on the executor, which must be a strand; close() may come from anywhere, also
// from it.
class UdpSocket : public std::enable_shared_from_this<UdpSocket> {
 public:
  // The datagram lives as long as the call.
  using Handler = std::function<void(const PeerAddress& from, std::span<const uint8_t>)>;

  // See bind_error() for the failures.
  static StatusOr<std::shared_ptr<UdpSocket>> open(asio::any_io_executor executor,
                                                   const UdpSocketSettings& settings, Handler handler);
  // Starts receiving.
  void start();
  // False: the queue is full and the datagram dropped (counted).
  bool send(const PeerAddress& to, Datagram datagram);
  void close();

  uint16_t port() const { return port_; }
  uint64_t dropped() const;
  // Of the last failed send or receive that was more than a full buffer, e.g. "Connection refused".
  std::string last_error() const;

 private:
  struct Queued {
    asio::ip::udp::endpoint to;
    Datagram datagram;
  };
  UdpSocket(asio::any_io_executor executor, const UdpSocketSettings& settings, Handler handler);
  void receive();
  void on_readable(SystemError error);
  void wait_writable();
  void flush();
  bool try_send(const asio::ip::udp::endpoint& to, const Datagram& datagram);

  static constexpr int kMaxBatch = 64;  // datagrams between two waits, so that timers get their turn
  mutable std::mutex mutex_;            // of all below
  asio::ip::udp::socket socket_;
  UdpSocketSettings settings_;
  Handler handler_;
  std::vector<uint8_t> buffer_;
  std::deque<Queued> queue_;
  uint16_t port_ = 0;
  bool ipv6_ = false, waiting_writable_ = false;
  uint64_t dropped_ = 0;
  std::string last_error_;
};

}  // namespace tessera::transport
