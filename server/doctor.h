// Why a daemon would not start, before it is started: `tesserad doctor`.
#pragma once

#include <string>
#include <vector>

#include "base/status.h"
#include "server/daemon.h"

namespace tessera::server {

struct Finding {
  std::string check;   // one of a fixed list, e.g. "control port"
  Status status;       // says what to do
  std::string detail;  // of what is well, e.g. the device's name
};

// Everything that start-up needs, each by itself; scenes are looked for, not loaded. Ports are opened for a
// moment.
std::vector<Finding> examine(const DaemonSettings& settings);

// The encoder that new sessions get, and why.
StatusOr<std::string> choose_encoder();

}  // namespace tessera::server
