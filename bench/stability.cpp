#include "bench/stability.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <nlohmann/json.hpp>

#include "absl/strings/str_format.h"

namespace tessera::bench {
namespace {

using nlohmann::json;

json to_json(const StabilityRow& row) {
  json out = {{"group", row.of.group},       {"case", row.of.name},    {"input", row.of.input},
              {"expected", row.of.expected}, {"passed", row.passed()}, {"measures", json::array()}};
  if (!row.status.ok()) out["failure"] = std::string(row.status.message());
  for (const StabilityMeasure& m : row.measures) {
    out["measures"].push_back(
        {{"what", m.what}, {"error", m.error}, {"bound", m.bound}, {"why", m.why}, {"passed", m.passed()}});
  }
  return out;
}

}  // namespace

std::vector<StabilityCase> stability_cases() {
  std::vector<StabilityCase> cases = geometry_stability_cases();
  for (StabilityCase& sampling : sampling_stability_cases()) cases.push_back(std::move(sampling));
  return cases;
}

bool StabilityRow::passed() const {
  return status.ok() && !measures.empty() &&
         std::ranges::all_of(measures, [](const StabilityMeasure& m) { return m.passed(); });
}

bool StabilityResult::passed() const {
  return validation_messages == 0 &&
         std::ranges::all_of(rows, [](const StabilityRow& row) { return row.passed(); });
}

StatusOr<StabilityResult> run_stability(const StabilitySettings& settings, Progress& progress) {
  StabilityResult result{.settings = settings};
  StabilityContext context{.device = nullptr, .sub_pixel_triangles = settings.sub_pixel_triangles};
  TESSERA_ASSIGN_OR_RETURN(context.device, gpu::Device::create({.select = settings.common.device,
                                                                .validation = settings.common.validation}));
  const gpu::DeviceInfo& info = context.device->info();
  result.device = {info.name, info.driver, info.software};
  std::vector<StabilityCase> cases = stability_cases();
  if (!settings.cases.empty())
    std::erase_if(cases, [&](const StabilityCase& c) { return !std::ranges::count(settings.cases, c.name); });
  progress.begin("cases", cases.size());
  for (StabilityCase& c : cases) {
    StabilityRow row{.of = std::move(c)};
    if (auto measures = row.of.run(context); measures.ok()) {
      row.measures = *std::move(measures);
    } else {
      row.status = measures.status();
    }
    result.rows.push_back(std::move(row));
    progress.advance();
  }
  result.validation_messages = context.device->validation_messages();
  return result;
}

json to_json(const StabilityResult& result) {
  json run = run_json(result.command, result.device, result.settings.common);
  run["settings"]["sub-pixel-triangles"] = result.settings.sub_pixel_triangles;
  run["passed"] = result.passed();
  run["stability"] = json::array();
  for (const StabilityRow& row : result.rows) run["stability"].push_back(to_json(row));
  return run;
}

std::string to_text(const StabilityResult& result) {
  std::string text;
  size_t failed = 0;
  for (const StabilityRow& row : result.rows) {
    failed += !row.passed();
    absl::StrAppendFormat(&text, "%s  %s: %s\n      %s; expected: %s\n", row.passed() ? "pass" : "FAIL",
                          row.of.group, row.of.name, row.of.input, row.of.expected);
    if (!row.status.ok()) absl::StrAppendFormat(&text, "      %s\n", row.status.message());
    for (const StabilityMeasure& m : row.measures)
      absl::StrAppendFormat(&text, "      %c %-30s %10.3g  <= %8.3g  (%s)\n", m.passed() ? ' ' : '!', m.what,
                            m.error, m.bound, m.why);
  }
  absl::StrAppendFormat(&text, "%d cases, %d failed\n", result.rows.size(), failed);
  if (result.validation_messages > 0)
    absl::StrAppendFormat(&text, "%d messages of the validation layers\n", result.validation_messages);
  return text;
}

void add_options(CLI::App& app, StabilitySettings& settings) {
  const std::vector<std::string> common = {"device", "json"};
  add_options(app, settings.common, common);
  app.add_option("--sub-pixel-triangles", settings.sub_pixel_triangles, "of the case that has so many")
      ->check(CLI::Range(1000, 10'000'000))
      ->group("Stability")
      ->envname("TESSERA_BENCH_SUB_PIXEL_TRIANGLES")
      ->capture_default_str();
  std::vector<std::string> names;
  for (const StabilityCase& c : stability_cases()) names.push_back(c.name);
  app.add_option("--cases", settings.cases, "which to run; default: all")
      ->check(CLI::IsMember(names))
      ->delimiter(',')
      ->group("Stability");
}

}  // namespace tessera::bench
