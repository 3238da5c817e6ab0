// A small HTTP/1.1 server for an operator's tools: GET and HEAD, one request a connection, bounded in every
// way.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "base/status.h"
#include "base/time.h"
#include "transport/asio/byte_stream.h"

namespace tessera::server {

struct HttpServerSettings {
  std::string address = "127.0.0.1";           // in numbers
  uint16_t port = 0;                           // 0: a free one
  std::shared_ptr<transport::TlsContext> tls;  // empty: clear text
  size_t max_connections = 32;                 // more are closed at once
  uint32_t max_header_bytes = 8192;            // of a request; a longer one gets 431
  DurationNs timeout_ns = 10 * kNsPerSecond;   // for a connection, from its first to its last byte
};

struct HttpResponse {
  unsigned status = 200;
  std::string content_type = "text/plain; charset=utf-8";
  std::string body;
};

// Serves on a thread of its own. Safe for untrusted input: what is no request gets 400, another method 405.
class HttpServer {
 public:
  // `path` is the target without its query. Called on the server's thread, one at a time.
  using Handler = std::function<HttpResponse(std::string_view path)>;

  // Failures: see bind_error().
  static StatusOr<std::unique_ptr<HttpServer>> open(const HttpServerSettings& settings, Handler handler);
  // Breaks off what is under way.
  ~HttpServer();

  uint16_t port() const;

 private:
  struct Impl;
  explicit HttpServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::server
