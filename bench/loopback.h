// The whole chain: in one process and in virtual time (server core → emulated link → client core, every
// displayed frame beside the truth), or by the real clock (real_loopback.h).
#pragma once

#include "base/status.h"
#include "bench/progress.h"
#include "bench/result.h"
#include "bench/settings.h"

namespace tessera::bench {

// Prints its estimated time first. With `estimate_only` the result is empty but for settings, machine and
// device.
StatusOr<LoopbackResult> run_loopback(const LoopbackSettings& settings, Progress& progress);

}  // namespace tessera::bench
