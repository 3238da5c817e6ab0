// The daemon's options: flags = config file keys = environment variables (TESSERAD_<OPTION>).
#pragma once

#include <string>

#include "server/daemon.h"

namespace CLI {
class App;
}

namespace tessera::server {

// Both must outlive the parse, and give the defaults.
void add_options(CLI::App& app, DaemonSettings& settings, std::string& log_level);

}  // namespace tessera::server
