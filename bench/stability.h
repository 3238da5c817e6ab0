// The stability catalogue (experiment E14): stiff and extreme input through the real chain, from import to
// the client's picture, with the measured error of each case. The bounds hold for tests/stability, too.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "bench/progress.h"
#include "bench/result.h"
#include "bench/settings.h"

namespace tessera::bench {

struct StabilityMeasure {
  std::string what;  // e.g. "colour, coherent"
  double error = 0;
  double bound = 0;
  std::string why;  // this bound

  bool passed() const { return error <= bound; }  // false for NaN
};

// What cases run on.
struct StabilityContext {
  std::shared_ptr<gpu::Device> device;
  uint32_t sub_pixel_triangles = 0;
};

struct StabilityCase {
  std::string group;  // "geometry" or "sampling"
  std::string name, input, expected;
  std::function<StatusOr<std::vector<StabilityMeasure>>(const StabilityContext&)> run;
};
std::vector<StabilityCase> geometry_stability_cases();
std::vector<StabilityCase> sampling_stability_cases();
std::vector<StabilityCase> stability_cases();  // all

struct StabilitySettings {
  LoopbackSettings common;                   // device, json
  uint32_t sub_pixel_triangles = 1'000'000;  // of that case
  std::vector<std::string> cases;            // names to run; none: all
};

struct StabilityRow {
  StabilityCase of;
  std::vector<StabilityMeasure> measures;
  Status status;  // an error: the case did not get as far as measuring

  bool passed() const;
};

struct StabilityResult {
  StabilitySettings settings;
  std::string command;
  DeviceDescription device;
  std::vector<StabilityRow> rows;
  uint64_t validation_messages = 0;  // of the validation layers, where they are on

  bool passed() const;
};

// A case that fails is a row, not an error.
StatusOr<StabilityResult> run_stability(const StabilitySettings& settings, Progress& progress);

nlohmann::json to_json(const StabilityResult& result);
std::string to_text(const StabilityResult& result);  // for people

// Adds this command's options.
void add_options(CLI::App& app, StabilitySettings& settings);

}  // namespace tessera::bench
