// Logging through spdlog. Programs call init_logging() once, before they start threads; libraries just log,
// on any thread.
#pragma once

#include <spdlog/spdlog.h>

#include <string_view>

namespace tessera {

// Log lines go to standard error, so that standard output stays machine-readable. `level` is one of
// trace, debug, info, warn, error, off; anything else means info.
void init_logging(std::string_view level);

}  // namespace tessera
