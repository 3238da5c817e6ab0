// The server's TCP (or TLS) port: takes connections, checks their hello, and hands them over.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>

#include "base/status.h"
#include "base/time.h"
#include "transport/asio/asio.h"
#include "transport/asio/meta_connection.h"
#include "transport/session_binding.h"

namespace tessera::transport {

struct MetaListenerSettings {
  std::string address = "127.0.0.1";
  uint16_t port = 0;                               // 0: a free one
  std::shared_ptr<TlsContext> tls;                 // empty: plain TCP
  DurationNs hello_timeout_ns = 5 * kNsPerSecond;  // from the connection to its hello, TLS handshake included
  size_t max_waiting = 64;                         // connections that have not said hello; more are refused
  size_t max_client_payload = 64u << 10;           // of frames that clients send, once they are known
  MetaConnectionSettings connection;               // max_payload is not used
};

// What becomes of a client whose hello is right.
struct Admission {
  Welcome welcome;
  MetaConnectionEvents events;
  // The welcome is the first frame in its queue.
  std::function<void(std::shared_ptr<MetaConnection>)> on_connected;
};

// Thread-safe. Close it before its last owner lets go.
class MetaListener : public std::enable_shared_from_this<MetaListener> {
 public:
  // Checks the token (in constant time). An error goes to the client and closes the connection;
  // Unauthenticated for a wrong token. Called on a connection's strand.
  using Admit = std::function<StatusOr<Admission>(const Hello& hello, const std::string& peer)>;

  // Failures: see bind_error().
  static StatusOr<std::shared_ptr<MetaListener>> open(asio::any_io_executor executor,
                                                      const MetaListenerSettings& settings, Admit admit);
  void close();  // connections that were handed over live on
  uint16_t port() const { return port_; }

 private:
  struct Waiting;
  MetaListener(asio::any_io_executor executor, const MetaListenerSettings& settings, Admit admit);
  void accept();
  void on_accepted(SystemError error, asio::ip::tcp::socket socket);
  void refuse(asio::ip::tcp::socket socket);
  void begin_hello(std::unique_ptr<ByteStream> stream, std::shared_ptr<Waiting> waiting);
  Status on_hello(const std::shared_ptr<Waiting>& waiting, FrameType type, std::span<const uint8_t> payload);
  void forget(const std::shared_ptr<Waiting>& waiting);

  asio::any_io_executor executor_;
  MetaListenerSettings settings_;
  Admit admit_;
  std::mutex mutex_;  // of all below
  asio::ip::tcp::acceptor acceptor_;
  asio::steady_timer retry_timer_;
  std::set<std::shared_ptr<Waiting>> waiting_;
  LogLimiter refusal_log_;
  uint16_t port_ = 0;
};

}  // namespace tessera::transport
