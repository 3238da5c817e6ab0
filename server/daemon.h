// The daemon without its command line: a device, its scenes, the stream server, and control by gRPC.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/status.h"
#include "base/time.h"

namespace tessera::server {

struct DaemonSettings {
  std::string address = "127.0.0.1";     // of all three ports, in numbers
  uint16_t control_port = 7310;          // gRPC; 0: a free one
  uint16_t meta_port = 7311;             // TCP; likewise
  uint16_t media_port = 7312;            // UDP; likewise
  std::string tls_certificate, tls_key;  // PEM files; both or none
  bool insecure = false;                 // other addresses than loopback in clear text
  uint32_t max_sessions = 32;
  std::vector<std::string> scenes;  // NAME=SOURCE, loaded at the start
  std::string scene_root;           // where LoadScene may read files; empty: nowhere
  std::string device = "cpu";

  bool operator==(const DaemonSettings&) const = default;
};

class Daemon {
 public:
  // Serves once it returns. `clock` outlives the daemon.
  static StatusOr<std::unique_ptr<Daemon>> start(const DaemonSettings& settings, const Clock& clock);
  // Lets nothing new in, tells the clients, and ends within a few seconds.
  ~Daemon();

  uint16_t control_port() const;
  uint16_t meta_port() const;
  uint16_t media_port() const;

 private:
  struct Impl;
  explicit Daemon(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::server
