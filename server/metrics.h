// What /metrics shows, in Prometheus' text format. Names, units and labels are an interface: dashboards and
// alerts in deploy/ use them.
#pragma once

#include <memory>
#include <string>

#include "server/control_service.h"
#include "server/scene_library.h"
#include "server/session.h"
#include "server/stream_server.h"

namespace tessera::server {

// Thread-safe.
class Metrics {
 public:
  explicit Metrics(const v1::ServerInfo& info);
  ~Metrics();

  // Once a frame.
  void on_rendered(const FrameStats& frame);
  // Labels are bounded: sessions by --max-sessions, refusals by calls and codes.
  std::string text(const StreamServer& streams, const SceneLibrary& scenes,
                   const ControlService& control) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::server
