// A network between one client and a StreamServer on 127.0.0.1: datagrams get lost, late and out of order
// from a seed, and the TCP connection can be held. Real sockets on both sides, so both ends run as they do
// elsewhere.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "base/time.h"
#include "server/stream_server.h"
#include "tests/transport/emulated_link.h"

namespace tessera::server::test {

struct NetworkSettings {
  transport::test::EmulatedLinkSettings up{.delay_ns = 0}, down{.delay_ns = 0};  // of datagrams
};

// Lies at a loopback address of its own, with the media port that the server's welcome names. Thread-safe.
class NetworkRelay {
 public:
  NetworkRelay(const SessionTicket& ticket, const NetworkSettings& settings, const Clock& clock);
  ~NetworkRelay();

  // Where the client connects to.
  const std::string& address() const;
  uint16_t meta_port() const;

  // What the server sends by TCP waits in front of the relay, which holds little.
  void hold_meta(bool held);
  // Datagrams that were lost on both ways.
  uint64_t lost() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::server::test
