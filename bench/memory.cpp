#include "bench/memory.h"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "absl/strings/str_join.h"
#include "gpu/device.h"

namespace tessera::bench {
namespace {

using nlohmann::json;

json to_json(const SpeedRow& row) {
  return {{"patches", row.patches},
          {"requests", row.requests},
          {"atlas_texels", row.atlas_texels},
          {"phases_ms", to_json(row.phases)},
          {"cpu_ms", to_json(row.cpu)},
          {"gpu_ms", to_json(row.gpu)},
          {"layout_ms", to_json(row.layout)},
          {"phases_ns_per_request", row.phases_ns_per_request()},
          {"differing_blocks", row.differing_blocks},
          {"out_of_memory", row.out_of_memory}};
}

json to_json(const StrategyRow& row) {
  return {{"strategy", name_of(row.strategy)},
          {"frames", row.frames},
          {"used", row.used},
          {"carried", row.carried},
          {"stacks", row.stacks},
          {"inaccessible", row.inaccessible},
          {"free", row.free},
          {"out_of_memory_frames", row.out_of_memory_frames},
          {"out_of_memory_patches", row.out_of_memory_patches},
          {"halved_frames", row.halved_frames},
          {"halved_patches", row.halved_patches},
          {"resets", row.resets},
          {"reset_frames", row.reset_frames},
          {"bias", row.bias},
          {"blocks", row.blocks},
          {"colors", row.colors}};
}

std::string joined(const std::vector<uint32_t>& values) {
  return values.empty() ? "0" : absl::StrJoin(values, ",");
}

std::string speed_text(const std::vector<SpeedRow>& rows) {
  std::string text =
      absl::StrFormat("%9s %9s %17s %17s %17s %17s %9s %9s\n", "visible", "requests", "phases, ms", "C++, ms",
                      "device, ms", "layout, ms", "differ", "no memory");
  const auto cell = [](const Percentiles& p) { return absl::StrFormat("%.3f / %.3f", p.p50, p.p95); };
  for (const SpeedRow& row : rows) {
    absl::StrAppendFormat(&text, "%9d %9d %17s %17s %17s %17s %9d %9d\n", row.patches, row.requests,
                          cell(row.phases), cell(row.cpu), cell(row.gpu), cell(row.layout),
                          row.differing_blocks, row.out_of_memory);
  }
  return text + "(median / 95th percentile)\n";
}

std::string strategies_text(const std::vector<StrategyRow>& rows) {
  std::string text =
      absl::StrFormat("%-9s %7s %8s %7s %13s %7s %14s %7s %7s %6s\n", "strategy", "used", "carried", "stacks",
                      "inaccessible", "free", "out of memory", "halved", "resets", "bias");
  const auto share = [](double value) { return absl::StrFormat("%.1f%%", 100 * value); };
  for (const StrategyRow& row : rows) {
    absl::StrAppendFormat(&text, "%-9s %7s %8s %7s %13s %7s %14s %7d %7d %6.2f\n", name_of(row.strategy),
                          share(row.used), share(row.carried), share(row.stacks), share(row.inaccessible),
                          share(row.free), absl::StrCat(row.out_of_memory_frames, " of ", row.frames),
                          row.halved_frames, row.resets, row.bias);
  }
  return text;
}

}  // namespace

MemorySettings::MemorySettings() {
  shared.fps = shared.server_fps = 120;  // the rate of thesis 3.6
  shared.size = {1920, 1080};
  shared.atlas = {2048, 2048};
  shared.pvs = Prediction::none;
}

void add_options(CLI::App& app, MemorySettings& settings) {
  const std::vector<std::string> names{"scene", "path",     "start", "fps",  "size", "fov-y", "server-fps",
                                       "atlas", "delay-ms", "pvs",   "seed", "json", "device"};
  add_options(app, settings.shared, names);
  app.add_option("--patches", settings.speed.patches, "visible patches of each speed row; 0 = no speed rows")
      ->delimiter(',')
      ->check(CLI::Range(0, 1'000'000))
      ->group("Memory")
      ->envname("TESSERA_BENCH_PATCHES")
      ->capture_default_str();
  app.add_option("--churn", settings.speed.churn, "share of the visible patches that change in a frame")
      ->check(CLI::Range(0.0, 1.0))
      ->group("Memory")
      ->envname("TESSERA_BENCH_CHURN")
      ->capture_default_str();
  app.add_option("--speed-frames", settings.speed.frames, "timed frames of each speed row")
      ->check(CLI::Range(1, 100'000))
      ->group("Memory")
      ->envname("TESSERA_BENCH_SPEED_FRAMES")
      ->capture_default_str();
  app.add_option("--frames", settings.frames, "frames on the path, at --server-fps; 0 = no strategies")
      ->check(CLI::Range(0, 1'000'000))
      ->group("Memory")
      ->envname("TESSERA_BENCH_FRAMES")
      ->capture_default_str();
}

std::vector<std::string> to_flags(const MemorySettings& settings) {
  std::vector<std::string> flags = to_flags(settings.shared, MemorySettings{}.shared);
  flags.push_back("--patches=" + joined(settings.speed.patches));
  flags.push_back(absl::StrCat("--churn=", settings.speed.churn));
  flags.push_back(absl::StrCat("--speed-frames=", settings.speed.frames));
  flags.push_back(absl::StrCat("--frames=", settings.frames));
  return flags;
}

StatusOr<MemoryResult> run_memory(const MemorySettings& settings, Progress& progress) {
  TESSERA_ASSIGN_OR_RETURN(const std::shared_ptr<gpu::Device> device,
                           gpu::Device::create({.select = settings.shared.device}));
  MemoryResult result{.settings = settings};
  result.device = {device->info().name, device->info().driver, device->info().software};
  TESSERA_ASSIGN_OR_RETURN(result.speed,
                           measure_speed(*device, settings.speed, settings.shared.seed, progress));
  if (settings.frames > 0) {
    TESSERA_ASSIGN_OR_RETURN(result.strategies,
                             compare_strategies(*device, settings.shared, settings.frames, progress));
  }
  return result;
}

json to_json(const MemoryResult& result) {
  json run = run_json(result.command, result.device, result.settings.shared);
  json& settings = run["settings"];
  settings["patches"] = result.settings.speed.patches;
  settings["churn"] = result.settings.speed.churn;
  settings["speed-frames"] = result.settings.speed.frames;
  settings["frames"] = result.settings.frames;
  run["rows"] = json::array();
  for (const SpeedRow& row : result.speed) run["rows"].push_back(to_json(row));
  for (const StrategyRow& row : result.strategies) run["rows"].push_back(to_json(row));
  return run;
}

std::string to_text(const MemoryResult& result) {
  std::string text;
  if (!result.speed.empty()) text += speed_text(result.speed);
  if (!result.strategies.empty()) text += strategies_text(result.strategies);
  return text;
}

}  // namespace tessera::bench
