// Time of atlas memory management for made-up patches: on the CPU, on the device, and the whole layout around
// it, in turn.
#pragma once

#include <cstdint>
#include <vector>

#include "base/status.h"
#include "bench/progress.h"
#include "bench/result.h"
#include "gpu/device.h"

namespace tessera::bench {

struct SpeedSettings {
  // Visible ones; as many are not. 0 = no row.
  std::vector<uint32_t> patches{50'000, 100'000, 200'000, 500'000};
  double churn = 0.05;   // share of the visible patches that others replace, a frame
  uint32_t frames = 40;  // timed, a row
};

// Times in ms, over the frames.
struct SpeedRow {
  uint32_t patches = 0;   // visible
  uint32_t requests = 0;  // of a frame: patches that come or go
  uint64_t atlas_texels = 0;
  Percentiles phases;  // the three phases in C++, for the requests alone
  Percentiles cpu;     // the same, and finding the requests among all patches, visible or not
  Percentiles gpu;     // the three phases on the device, over all patches; device time
  Percentiles layout;  // blocks::Layout::update: level selection, placements and what changed as well
  uint64_t differing_blocks = 0;  // between C++ and the device, in all frames
  uint64_t out_of_memory = 0;     // requests, in all frames

  double phases_ns_per_request() const;
};

StatusOr<std::vector<SpeedRow>> measure_speed(gpu::Device& device, const SpeedSettings& settings,
                                              uint64_t seed, Progress& progress);

}  // namespace tessera::bench
