// The daemon's options: flags = config file keys = environment variables (TESSERAD_<OPTION>).
#pragma once

#include <string>

#include "server/daemon.h"

namespace CLI {
class App;
}

namespace tessera::server {

struct LogSettings {
  std::string level = "info";
  std::string format = "text";
  bool operator==(const LogSettings&) const = default;
};

// Both must outlive the parse, and give the defaults.
void add_options(CLI::App& app, DaemonSettings& settings, LogSettings& log);

}  // namespace tessera::server
