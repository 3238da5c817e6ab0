// The daemon without its command line: a device, its scenes, the stream server, and control by gRPC.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/status.h"
#include "base/time.h"
#include "server/stream_server.h"

namespace tessera::server {

struct DaemonSettings {
  std::string address = "127.0.0.1";  // of all ports, in numbers
  uint16_t control_port = 7310;       // gRPC; 0: a free one
  uint16_t meta_port = 7311;          // TCP; likewise
  uint16_t media_port = 7312;         // UDP; likewise
  uint16_t http_port = 7313;          // metrics and health; likewise
  bool no_http = false;
  std::string tls_certificate, tls_key;  // PEM files; both or none
  std::string control_token_file;        // its first line is what control calls must show; empty: nothing
  bool insecure = false;  // other addresses than loopback in clear text, without a control token
  uint32_t max_sessions = 32;
  uint32_t max_atlas_mtexels = 128;  // 2^20 texels, of all sessions together
  uint32_t max_scene_mib = 0;        // device memory of all scenes together; 0: what the device has
  uint32_t max_watchers = 64;        // calls that stay open
  uint32_t idle_timeout = 300;       // seconds that a session is kept without a client; 0: for ever
  std::vector<std::string> scenes;   // NAME=SOURCE, loaded at the start
  std::string scene_root;            // where LoadScene may read files; empty: nowhere
  std::string device = "cpu";
  std::string gather = "auto";  // which passes shade the atlas: a name of shading::kGatherPathNames

  bool operator==(const DaemonSettings&) const = default;
};

// InvalidArgument: only one of the two TLS files, one that does not fit, or clear text beyond loopback
// without `insecure`.
StatusOr<StreamServerSettings> stream_settings(const DaemonSettings& settings);
// Of a scene option. InvalidArgument: not NAME=SOURCE.
StatusOr<std::pair<std::string, std::string>> name_and_source(const std::string& scene);
// What control calls must show; empty: nothing. InvalidArgument: an unfit file, or none for an address beyond
// loopback without `insecure`.
StatusOr<std::string> control_token(const DaemonSettings& settings);
// All of these, of all settings; ports, scenes and devices are not touched.
Status check(const DaemonSettings& settings);
const char* version();

class Daemon {
 public:
  // Serves once it returns; /healthz and /readyz answer from its first moments on. `clock` outlives the
  // daemon.
  static StatusOr<std::unique_ptr<Daemon>> start(const DaemonSettings& settings, const Clock& clock);
  // Drains, tells the clients, and ends within a few seconds.
  ~Daemon();

  // Lets nothing new in: calls that would are UNAVAILABLE, /readyz is 503, watchers are sent home. Sessions
  // go on.
  void drain();

  uint16_t control_port() const;
  uint16_t meta_port() const;
  uint16_t media_port() const;
  uint16_t http_port() const;  // 0: none

 private:
  struct Impl;
  explicit Daemon(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::server
