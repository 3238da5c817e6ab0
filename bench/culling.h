// What culling saves (part of experiment E6): the id buffers of a session's predicted views, with culling and
// with every triangle drawn, in turn.
#pragma once

#include "bench/progress.h"
#include "bench/result.h"
#include "bench/settings.h"

namespace tessera::bench {

struct CullingFrame {
  double path_s = 0;                                 // where on the path
  double culled_ms = 0, all_ms = 0;                  // device time of all views
  uint64_t culled_triangles = 0, all_triangles = 0;  // submitted
  size_t patches = 0;                                // visible
  size_t differing_patches = 0;                      // visible with culling only, or without only

  double ratio() const { return all_ms > 0 ? culled_ms / all_ms : 1; }
};

struct CullingResult {
  LoopbackSettings settings;
  std::string command;
  DeviceDescription device;
  std::vector<CullingFrame> frames;

  Percentiles ratio() const;
  size_t differing_patches() const;
};

nlohmann::json to_json(const CullingResult& result);

// Follows the path at the server's frame rate; of `settings` it uses input, client, server-fps, pvs, delay
// and device. The first frame, whose culling knows nothing yet, is among the results.
StatusOr<CullingResult> run_culling(const LoopbackSettings& settings, Progress& progress);

// Names of the options that count here.
std::vector<std::string> culling_options();

}  // namespace tessera::bench
