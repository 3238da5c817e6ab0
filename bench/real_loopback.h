// The product as its users run it: tesserad and tessera-clients as processes, over loopback sockets and by
// the real clock. Measures latency; the first client's pictures are scored after the run.
#pragma once

#include "base/status.h"
#include "bench/progress.h"
#include "bench/result.h"
#include "bench/settings.h"

namespace tessera::bench {

// Both programs lie beside this one. A row for each session.
StatusOr<LoopbackResult> run_real_loopback(const LoopbackSettings& settings, Progress& progress);

}  // namespace tessera::bench
