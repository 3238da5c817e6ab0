// Atlas memory (experiment E8): how long its management takes, and where the atlas's texels are under the
// strategies of thesis 3.6.3.
#pragma once

#include <string>
#include <vector>

#include "bench/memory_speed.h"
#include "bench/memory_strategies.h"
#include "bench/progress.h"
#include "bench/result.h"
#include "bench/settings.h"

namespace tessera::bench {

struct MemorySettings {
  // Path frames follow each other at server-fps.
  LoopbackSettings shared;
  SpeedSettings speed;
  uint32_t frames = 1000;  // on the path; 0 = leave the strategies out

  MemorySettings();
};

struct MemoryResult {
  MemorySettings settings;
  std::string command;
  DeviceDescription device;
  std::vector<SpeedRow> speed;
  std::vector<StrategyRow> strategies;
};

// Adds the options of `memory`. `settings` must outlive the parse, and gives the defaults.
void add_options(CLI::App& app, MemorySettings& settings);
std::vector<std::string> to_flags(const MemorySettings& settings);

StatusOr<MemoryResult> run_memory(const MemorySettings& settings, Progress& progress);

nlohmann::json to_json(const MemoryResult& result);
// The result as tables for people.
std::string to_text(const MemoryResult& result);

}  // namespace tessera::bench
