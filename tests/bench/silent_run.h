// A study or a loopback run whose progress nobody reads.
#pragma once

#include <sstream>

#include "bench/progress.h"

namespace tessera::bench {

// As run(settings, progress).
template <class Run, class Settings>
auto run_silently(Run run, const Settings& settings) {
  std::ostringstream nobody;
  Progress progress(nobody);
  return run(settings, progress);
}

}  // namespace tessera::bench
