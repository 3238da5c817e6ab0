// A connected stream of bytes: plain TCP, or TLS over it.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "base/status.h"
#include "transport/asio/asio.h"

namespace tessera::transport {

// Not thread-safe; one read and one write may be under way. Handlers run on the socket's executor.
class ByteStream {
 public:
  using Handler = std::function<void(SystemError, size_t bytes)>;

  virtual ~ByteStream() = default;
  // Before anything else. Plain TCP has nothing to agree on.
  virtual void async_handshake(std::function<void(SystemError)> handler) = 0;
  virtual void async_read_some(asio::mutable_buffer buffer, Handler handler) = 0;
  virtual void async_write_some(asio::const_buffer buffer, Handler handler) = 0;
  // Ends what is under way with an error.
  virtual void close() = 0;
  virtual asio::any_io_executor executor() = 0;
};

std::unique_ptr<ByteStream> make_plain_stream(asio::ip::tcp::socket socket);

// Certificates and keys as PEM files.
struct TlsServerSettings {
  std::string certificate_chain_file, private_key_file;
};
struct TlsClientSettings {
  std::string authority_file;  // empty: the system's
  std::string server_name;     // that the certificate must have
};

// Makes streams of one kind of TLS (1.2 or newer). Thread-safe; streams may outlive it.
class TlsContext {
 public:
  // InvalidArgument: a file that cannot be read or does not fit, by name.
  static StatusOr<std::shared_ptr<TlsContext>> server(const TlsServerSettings& settings);
  static StatusOr<std::shared_ptr<TlsContext>> client(const TlsClientSettings& settings);
  ~TlsContext();
  std::unique_ptr<ByteStream> make_stream(asio::ip::tcp::socket socket) const;

 private:
  struct Impl;
  explicit TlsContext(std::shared_ptr<Impl> impl);
  std::shared_ptr<Impl> impl_;
};

}  // namespace tessera::transport
