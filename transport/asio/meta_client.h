// The client's end of the meta connection: connects, says hello, and waits for the welcome.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "base/status.h"
#include "base/time.h"
#include "transport/asio/asio.h"
#include "transport/asio/meta_connection.h"

namespace tessera::transport {

struct MetaClientSettings {
  std::string server_address = "127.0.0.1";  // in numbers
  uint16_t server_port = 0;
  std::shared_ptr<TlsContext> tls;                   // empty: plain TCP
  DurationNs connect_timeout_ns = 8 * kNsPerSecond;  // for all steps together
  Hello hello;
  MetaConnectionSettings connection;
};

// The result comes once: the connection and the server's welcome, or an error that names the step that failed
// (connect, TLS, hello). Unavailable: no tesserad is there; DeadlineExceeded: it was reached, and then said
// nothing for too long. Then frames go to `events`; a failed connect calls none of them. Everything runs on
// a strand of `executor`.
using OnWelcome = std::function<void(StatusOr<std::shared_ptr<MetaConnection>>, const Welcome&)>;
void connect_meta(asio::any_io_executor executor, const MetaClientSettings& settings,
                  MetaConnectionEvents events, OnWelcome on_welcome);

}  // namespace tessera::transport
