#include "bench/result.h"

#include <sys/resource.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "bench/version.h"

namespace tessera::bench {
namespace {

using nlohmann::json;

json to_json(const Row& row) {
  json j{{"method", row.method},
         {"session", row.session},
         {"mssim", row.error.mssim},
         {"dssim", row.error.dssim()},
         {"psnr", row.error.psnr},
         {"psnr_rgb", row.error.psnr_rgb},
         {"ssim7", row.error.ssim7},
         {"linf", row.error.linf},
         {"l2", row.error.l2},
         {"delta_e_borders", row.error.delta_e_borders},
         {"mbps_total", row.mbps_total},
         {"mbps_atlas", row.mbps_atlas},
         {"mbps_meta", row.mbps_meta},
         {"frames_displayed", row.frames_displayed},
         {"frames_stale", row.frames_stale},
         {"frames_lost", row.frames_lost},
         {"server_ms", row.server_ms},
         {"client_ms", row.client_ms},
         {"peak_rss_mib", row.peak_rss_mib},
         {"device_mib", row.device_mib}};
  if (!row.note.empty()) j["note"] = row.note;
  if (row.violations) j["violations"] = *row.violations;
  if (row.samples_shaded) j["samples_shaded"] = *row.samples_shaded;
  if (row.holes) j["holes"] = *row.holes;
  if (row.coverage) j["coverage"] = *row.coverage;
  if (row.coverage_without_prediction) j["coverage_without_prediction"] = *row.coverage_without_prediction;
  if (row.overestimation) j["overestimation"] = *row.overestimation;
  if (row.mssim_masked) j["mssim_masked"] = *row.mssim_masked;
  if (row.tiling_error_ms_max) j["tiling_error_ms_max"] = *row.tiling_error_ms_max;
  if (row.server_fps) j["server_fps"] = *row.server_fps;
  if (row.first_picture_ms) j["first_picture_ms"] = *row.first_picture_ms;
  if (row.overhead_ms) j["overhead_ms"] = to_json(*row.overhead_ms);
  if (row.end_to_end_ms) j["end_to_end_ms"] = to_json(*row.end_to_end_ms);
  for (const auto& [name, p] : row.durations_ms) j["durations_ms"][name] = to_json(p);
  return j;
}

json to_json(const SplitRow& row) {
  return {{"cause", row.cause},
          {"mssim", row.mssim},
          {"dssim", (1 - row.mssim) / 2},
          {"psnr", row.psnr},
          {"added", row.added}};
}

json to_json(const DisplayRecord& f) {
  json j{{"time_ns", f.time_ns},         {"frame", f.frame},
         {"age_ms", f.age_ms},           {"holes", f.holes},
         {"atlas_bytes", f.atlas_bytes}, {"meta_bytes", f.meta_bytes}};
  if (!f.mssim.empty()) j["mssim"] = f.mssim;
  if (!f.psnr.empty()) j["psnr"] = f.psnr;
  return j;
}

template <class T>
json to_array(const std::vector<T>& values) {
  json array = json::array();
  for (const T& value : values) array.push_back(to_json(value));
  return array;
}

std::string processor_name() {
  std::ifstream in("/proc/cpuinfo");
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with("model name")) return line.substr(std::min(line.size(), line.find(": ") + 2));
  }
  return "unknown";
}

}  // namespace

Percentiles percentiles(std::vector<double> values) {
  if (values.empty()) return {};
  std::sort(values.begin(), values.end());
  const auto at = [&values](double share) {
    const double rank = share * static_cast<double>(values.size() - 1);
    const auto below = static_cast<size_t>(rank);
    const size_t above = std::min(below + 1, values.size() - 1);
    return std::lerp(values[below], values[above], rank - static_cast<double>(below));
  };
  return {at(0.50), at(0.95), at(0.99)};
}

void add_durations(std::span<const FrameRecord> records, Row& row) {
  std::map<std::string, std::vector<double>> values;
  std::vector<double> end_to_end, overhead;
  DurationNs tiling = 0;
  for (const FrameRecord& record : records) {
    const auto d = durations(record);
    if (!d) continue;
    for (const auto& [name, duration] : d->named()) values[std::string(name)].push_back(to_ms(duration));
    end_to_end.push_back(to_ms(d->end_to_end));
    overhead.push_back(to_ms(d->overhead));
    tiling = std::max(tiling, std::abs(d->end_to_end - d->sum()));
  }
  for (auto& [name, list] : values) row.durations_ms[name] = percentiles(std::move(list));
  row.end_to_end_ms = percentiles(std::move(end_to_end));
  row.overhead_ms = percentiles(std::move(overhead));
  row.tiling_error_ms_max = to_ms(tiling);
}

json to_json(const Percentiles& p) {
  return {{"p50", p.p50}, {"p95", p.p95}, {"p99", p.p99}};
}

json run_json(const std::string& command, const DeviceDescription& device, const LoopbackSettings& settings) {
  return {{"schema", kSchema},
          {"command", command},
          {"commit", kCommit},
          {"machine", machine_json()},
          {"device", {{"name", device.name}, {"driver", device.driver}, {"software", device.software}}},
          {"settings", to_json(settings)}};
}

json to_json(const LoopbackResult& result) {
  json run = run_json(result.command, result.device, result.settings);
  run["notes"] = result.notes;
  run["plan"] = result.plan;
  run["rows"] = to_array(result.rows);
  run["split"] = to_array(result.split);
  run["frames"] = to_array(result.frames);
  return run;
}

json machine_json() {
  utsname name{};
  uname(&name);
  const double mib =
      static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGE_SIZE)) / (1 << 20);
  return {{"cpu", processor_name()},
          {"cores", std::thread::hardware_concurrency()},
          {"memory_mib", std::llround(mib)},
          {"os", std::string(name.sysname) + " " + name.release}};
}

double peak_rss_mib() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;  // kilobytes on Linux
}

}  // namespace tessera::bench
