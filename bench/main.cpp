// tessera-bench: measures Tessera.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "absl/strings/str_join.h"
#include "base/frame_trace.h"
#include "base/log.h"
#include "bench/codec_study.h"
#include "bench/culling.h"
#include "bench/file_io.h"
#include "bench/gather_study.h"
#include "bench/layout_study.h"
#include "bench/loopback.h"
#include "bench/memory.h"
#include "bench/report.h"
#include "bench/spatial.h"
#include "bench/stability.h"
#include "bench/version.h"

namespace {

using namespace tessera;

enum ExitCode { kOk = 0, kFailed = 1, kUsage = 2 };

constexpr char kFooter[] =
    R"(Configuration: every option is also an environment variable (--delay-ms = TESSERA_BENCH_DELAY_MS) and a key
of the --config file, under [loopback], [culling], [memory], [spatial], [codec], [gather], [layouts] or [stability].
Flags win over the file, the file over the environment.

Exit codes: 0 done, 1 the run failed (of stability: a case did), 2 wrong usage.)";

constexpr char kLoopbackFooter[] = R"(Examples:
  tessera-bench loopback --report report
  tessera-bench loopback --scene sponza.glb --path sponza_1.csv --seconds 3 --json sponza.json --report report
  tessera-bench loopback --delay-ms 100 --jitter-ms 10 --loss 0.01 --baselines none
  tessera-bench loopback --pvs none --split off
  tessera-bench loopback --clock real --sessions 4 --trace trace.json
  tessera-bench loopback --scene city:1000000 --path city --estimate-only)";

int report_failure(const Status& status) {
  std::cerr << "tessera-bench: " << status.message() << std::endl;
  return kFailed;
}

constexpr char kCullingFooter[] = R"(Example:
  tessera-bench culling --scene viking_village.glb --path viking_village_1.csv --seconds 1)";

constexpr char kCodecFooter[] = R"(Examples:
  tessera-bench codec --mtexels 1,2
  tessera-bench codec --scene sponza.glb --path sponza_1.csv --start 10 --size 1920x1080 --mtexels 8 --json codec.json

Atlases of the scene are filled up with their own squares, so that every texel holds a sample, or every other square of
64x64 is left empty; then both codecs code them in turn. The lower table is of the client's picture, the atlas as it is.)";

constexpr char kStabilityFooter[] = R"(Examples:
  tessera-bench stability --json stability.json
  tessera-bench stability --cases sliver-1e7,t-junctions

Each case goes from import to the client's picture, with each of the three layouts where that makes sense. An error is
the largest difference of a colour (of 1), or a share of pixels or samples.)";

constexpr char kMemoryFooter[] = R"(Examples:
  tessera-bench memory --frames 0 --json speed.json
  tessera-bench memory --patches 0 --scene sponza.glb --path sponza_1.csv --server-fps 60
  tessera-bench memory --patches 0 --scene robot_lab.glb --path robot_lab_3.csv --atlas 2048x1024 --json lab.json)";

constexpr char kLayoutsFooter[] = R"(Examples:
  tessera-bench layouts
  tessera-bench layouts --scene sponza.glb --path sponza_1.csv --seconds 3 --json layouts.json --report report
  tessera-bench layouts --atlases 2048x1024 --bitrates-mbps 5,10,20,40 --speed 0.25)";

constexpr char kSpatialFooter[] = R"(Examples:
  tessera-bench spatial --report report
  tessera-bench spatial --scene sponza.glb --path sponza_1.csv --seconds 10 --json spatial.json --report report
  tessera-bench spatial --size 960x540 --atlas 2048x2048 --server-fps 0.5)";

constexpr char kGatherFooter[] = R"(Examples:
  tessera-bench gather --json gather.json --report report
  tessera-bench gather --scene sponza.glb --path sponza_1.csv --start 10 --rounds 15
  tessera-bench gather --groups blocks,costs --samples 200000

Each load is shaded on every path, after a forward picture; ratios are those of the same round, medians and quartiles.)";

template <class Settings>
std::string command_line(std::string command, const Settings& settings) {
  for (const std::string& flag : bench::to_flags(settings)) command += " " + flag;
  return command;
}

Status write_frames(const std::string& file, std::span<const FrameRecord> records,
                    void (*write)(std::span<const FrameRecord>, std::ostream&)) {
  if (file.empty()) return absl::OkStatus();
  std::ostringstream out;
  write(records, out);
  return bench::write_file(file, out.str());
}

Status write_outputs(const bench::LoopbackResult& result) {
  if (!result.settings.json.empty()) {
    TESSERA_RETURN_IF_ERROR(bench::write_file(result.settings.json, bench::to_json(result).dump(1) + "\n"));
  }
  TESSERA_RETURN_IF_ERROR(write_frames(result.settings.frames_csv, result.records, write_csv));
  TESSERA_RETURN_IF_ERROR(write_frames(result.settings.trace, result.records, write_chrome_trace));
  if (result.settings.report.empty()) return absl::OkStatus();
  TESSERA_RETURN_IF_ERROR(bench::write_run(result.settings.report, result).status());
  TESSERA_RETURN_IF_ERROR(bench::write_report(result.settings.report));
  std::cerr << "report: " << result.settings.report << "/index.html" << std::endl;
  return absl::OkStatus();
}

void print_latency(const bench::LoopbackResult& result) {
  for (const bench::Row& row : result.rows) {
    if (!row.overhead_ms) continue;  // it showed nothing
    const double fps = row.server_fps.value_or(0);
    std::cout << absl::StrFormat("session %d: %.1f server frames/s; ms, p50 / p99:", row.session, fps);
    for (const auto& [name, p] : row.durations_ms)
      std::cout << absl::StrFormat(" %s %.1f / %.1f,", name, p.p50, p.p99);
    std::cout << absl::StrFormat(" end to end %.1f / %.1f; overhead %.2f / %.2f; tiling error at most %.3f\n",
                                 row.end_to_end_ms->p50, row.end_to_end_ms->p99, row.overhead_ms->p50,
                                 row.overhead_ms->p99, *row.tiling_error_ms_max);
    std::cout << absl::StrFormat("session %d: first picture after %.1f\n", row.session,
                                 row.first_picture_ms.value_or(0));
  }
}

void print_summary(const bench::LoopbackResult& result) {
  std::cout << absl::StrFormat("%-14s %8s %8s %8s %9s %9s\n", "method", "mssim", "psnr", "holes", "Mbit/s",
                               "violations");
  for (const bench::Row& row : result.rows) {
    const std::string holes = row.holes ? absl::StrFormat("%.4f%%", 100 * *row.holes) : "-";
    std::cout << absl::StrFormat("%-14s %8.4f %8.2f %8s %9.2f %9s\n", row.method, row.error.mssim,
                                 row.error.psnr, holes, row.mbps_total,
                                 row.violations ? absl::StrCat(*row.violations) : "-");
  }
  for (const bench::SplitRow& row : result.split) {
    std::cout << absl::StrFormat("without %-12s %.4f  (it adds %.4f)\n", row.cause, row.mssim, row.added);
  }
}

// Where one was asked for.
template <class Result>
int write_json(const std::string& path, const Result& result) {
  if (path.empty()) return kOk;
  const Status written = bench::write_file(path, bench::to_json(result).dump(1) + "\n");
  return written.ok() ? kOk : report_failure(written);
}

// And a page, where one was asked for.
template <class Result>
int write_files(const bench::LoopbackSettings& settings, const Result& result,
                Status (*write_report)(const std::string& folder, const Result& result), const char* page) {
  if (const int code = write_json(settings.json, result); code != kOk) return code;
  if (settings.report.empty()) return kOk;
  const Status written = write_report(settings.report, result);
  if (!written.ok()) return report_failure(written);
  std::cerr << "report: " << settings.report << "/" << page << std::endl;
  return kOk;
}

// On standard error.
template <class Result, class Settings>
StatusOr<Result> with_progress(StatusOr<Result> (*run)(const Settings&, bench::Progress&),
                               const Settings& settings) {
  const SteadyClock clock;
  bench::Progress progress(std::cerr, isatty(STDERR_FILENO), clock);
  return run(settings, progress);
}

int run_loopback(const bench::LoopbackSettings& settings) {
  StatusOr<bench::LoopbackResult> result = with_progress(bench::run_loopback, settings);
  if (!result.ok()) return report_failure(result.status());
  if (settings.estimate_only) return kOk;
  result->settings = settings;
  result->command = command_line("tessera-bench loopback", settings);
  print_summary(*result);
  if (settings.clock == "real") print_latency(*result);
  const Status written = write_outputs(*result);
  return written.ok() ? kOk : report_failure(written);
}

int run_culling(const bench::LoopbackSettings& settings) {
  StatusOr<bench::CullingResult> result = with_progress(bench::run_culling, settings);
  if (!result.ok()) return report_failure(result.status());
  result->command = command_line("tessera-bench culling", settings);
  const bench::Percentiles ratio = result->ratio();
  std::cout << absl::StrFormat("id buffers, culled / all drawn: median %.3f, p95 %.3f, first frame %.3f\n",
                               ratio.p50, ratio.p95, result->frames.front().ratio());
  std::cout << "visible sets: " << result->differing_patches() << " patches differ in all frames together"
            << std::endl;
  return write_json(settings.json, *result);
}

int run_memory(const bench::MemorySettings& settings) {
  StatusOr<bench::MemoryResult> result = with_progress(bench::run_memory, settings);
  if (!result.ok()) return report_failure(result.status());
  result->command = command_line("tessera-bench memory", settings);
  std::cout << bench::to_text(*result) << std::flush;
  return write_json(settings.shared.json, *result);
}

int run_spatial(const bench::SpatialSettings& settings) {
  StatusOr<bench::SpatialResult> result = with_progress(bench::run_spatial, settings);
  if (!result.ok()) return report_failure(result.status());
  result->command =
      absl::StrFormat("%s --eye-distance-mm=%g", command_line("tessera-bench spatial", settings.common),
                      settings.eye_distance_mm);
  std::cout << absl::StrFormat("%-16s %-9s %10s %10s %8s %8s %8s %8s %9s\n", "method", "bias", "samples",
                               "per pixel", "saved", "to mono", "mssim", "center", "holes");
  for (const bench::SpatialRow& row : result->rows) {
    std::cout << absl::StrFormat("%-16s %-9s %10.0f %10.3f %7.1f%% %8.3f %8.4f %8.4f %8.4f%%\n",
                                 row.method.name, row.method.bias_name(), row.samples, row.per_pixel,
                                 100 * (1 - row.per_pixel), row.to_mono, row.mssim, row.mssim_center,
                                 100 * row.holes);
  }
  return write_files(settings.common, *result, bench::write_spatial_report, "spatial.html");
}

void print_summary(const bench::CodecStudyResult& result) {
  std::cout << absl::StrFormat("%-5s %-10s %5s %16s %16s %11s %7s %7s  %s\n", "codec", "atlas", "fill",
                               "encode ms/Mtexel", "decode ms/Mtexel", "bits/sample", "ssim", "psnr",
                               "half empty / full: CPU to encode, to decode, bits of equal quality");
  for (const bench::CodecRow& row : result.rows) {
    std::cout << absl::StrFormat("%-5s %-10s %5.2f %16.2f %16.2f %11.3f %7.4f %7.2f",
                                 std::string(name_of(row.codec)), absl::StrCat(row.width, "x", row.height),
                                 row.fill, row.encode_ms_per_mtexel.p50, row.decode_ms_per_mtexel.p50,
                                 row.bits_per_sample, row.ssim, row.psnr);
    if (row.equal_quality_share)
      std::cout << absl::StrFormat("  %.3f, %.3f, %.3f", *row.encode_time_share, *row.decode_time_share,
                                   *row.equal_quality_share);
    std::cout << "\n";
  }
  std::cout << absl::StrFormat("%-5s %-10s %5s %7s %7s %7s  %s\n", "codec", "atlas", "used", "Mbit", "mssim",
                               "psnr", "against the truth: uncoded, coded");
  for (const bench::CodecPictureRow& row : result.pictures)
    std::cout << absl::StrFormat("%-5s %-10s %5.2f %7.3f %7.4f %7.2f  %.4f, %.4f\n",
                                 std::string(name_of(row.codec)), absl::StrCat(row.width, "x", row.height),
                                 row.used, row.mbits, row.mssim, row.psnr, row.truth_uncoded,
                                 row.truth_coded);
}

int run_codec(const bench::CodecStudySettings& settings) {
  StatusOr<bench::CodecStudyResult> result = with_progress(bench::run_codec_study, settings);
  if (!result.ok()) return report_failure(result.status());
  result->command =
      absl::StrCat(command_line("tessera-bench codec", settings.common),
                   " --mtexels=", absl::StrJoin(settings.mtexels, ","),
                   " --bits-per-texel=", settings.bits_per_texel, " --rounds=", settings.rounds);
  print_summary(*result);
  return write_json(settings.common.json, *result);
}

int run_gather(const bench::GatherStudySettings& settings) {
  StatusOr<bench::GatherStudyResult> result = with_progress(bench::run_gather_study, settings);
  if (!result.ok()) return report_failure(result.status());
  result->command = command_line("tessera-bench gather", settings);
  std::cout << bench::to_text(*result) << std::flush;
  return write_files(settings.common, *result, bench::write_gather_report, "gather.html");
}

std::string command_of(const bench::LayoutStudySettings& settings) {
  std::string command =
      absl::StrCat(command_line("tessera-bench layouts", settings.common),
                   " --layouts=", absl::StrJoin(settings.layouts, ","),
                   " --atlases=", absl::StrJoin(settings.atlases, ",", absl::StreamFormatter()),
                   " --speed=", settings.speed, " --texture-mtexels=", settings.texture_mtexels);
  if (!settings.bitrates_mbps.empty())
    absl::StrAppend(&command, " --bitrates-mbps=", absl::StrJoin(settings.bitrates_mbps, ","));
  return command;
}

int run_layouts(const bench::LayoutStudySettings& settings) {
  StatusOr<bench::LayoutStudyResult> result = with_progress(bench::run_layout_study, settings);
  if (!result.ok()) return report_failure(result.status());
  result->command = command_of(settings);
  std::cout << bench::to_text(*result) << std::flush;
  return write_files(settings.common, *result, bench::write_layout_report, "layouts.html");
}

int run_stability(const bench::StabilitySettings& settings) {
  StatusOr<bench::StabilityResult> result = with_progress(bench::run_stability, settings);
  if (!result.ok()) return report_failure(result.status());
  result->command = absl::StrCat(command_line("tessera-bench stability", settings.common),
                                 " --sub-pixel-triangles=", settings.sub_pixel_triangles);
  if (!settings.cases.empty())
    absl::StrAppend(&result->command, " --cases=", absl::StrJoin(settings.cases, ","));
  std::cout << bench::to_text(*result) << std::flush;
  const int written = write_json(settings.common.json, *result);
  return written != kOk ? written : result->passed() ? kOk : kFailed;
}

int run_report(const std::string& folder) {
  const Status written = bench::write_report(folder);
  if (!written.ok()) return report_failure(written);
  std::cerr << "report: " << folder << "/index.html" << std::endl;
  return kOk;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Measures Tessera: error, bit rate and run time of the whole chain.", "tessera-bench");
  app.set_version_flag("--version", std::string("tessera-bench ") + bench::kCommit);
  app.footer(kFooter);
  app.require_subcommand(1);
  app.set_config("--config", "", "read options from this TOML or INI file");
  std::string log_level = "warn";
  app.add_option("--log", log_level, "log level on standard error")
      ->check(CLI::IsMember({"trace", "debug", "info", "warn", "error", "off"}))
      ->envname("TESSERA_BENCH_LOG")
      ->capture_default_str();

  const auto command = [&app](const char* name, const char* description, const char* footer) {
    CLI::App* added = app.add_subcommand(name, description);
    added->footer(footer);
    added->fallthrough();
    return added;
  };

  CLI::App* loopback =
      command("loopback", "server → network → client, scored frame by frame", kLoopbackFooter);
  bench::LoopbackSettings settings;
  bench::add_options(*loopback, settings);

  CLI::App* culling =
      command("culling", "id-buffer time with culling against drawing everything", kCullingFooter);
  bench::LoopbackSettings culling_settings;
  bench::add_options(*culling, culling_settings, bench::culling_options());

  CLI::App* memory =
      command("memory", "atlas memory: time, and where its texels are by strategy", kMemoryFooter);
  bench::MemorySettings memory_settings;
  bench::add_options(*memory, memory_settings);

  CLI::App* spatial =
      command("spatial", "samples and error of stereo, foveation, lenses and upsampling", kSpatialFooter);
  bench::SpatialSettings spatial_settings = bench::default_spatial_settings();
  bench::add_options(*spatial, spatial_settings.common, bench::spatial_options());
  spatial->add_option("--eye-distance-mm", spatial_settings.eye_distance_mm, "between the two eyes")
      ->check(CLI::Range(0.0, 1000.0))
      ->envname("TESSERA_BENCH_EYE_DISTANCE_MM")
      ->group("Client")
      ->capture_default_str();
  std::vector<std::string> methods;
  for (const bench::SpatialCase& method : bench::spatial_cases())
    if (std::ranges::find(methods, method.name) == methods.end()) methods.push_back(method.name);
  spatial->add_option("--methods", spatial_settings.methods, "which to measure; default: all")
      ->check(CLI::IsMember(methods))
      ->delimiter(',')
      ->group("Server");

  CLI::App* codec = command("codec", "time, bits and error of the atlas's codecs", kCodecFooter);
  bench::CodecStudySettings codec_settings;
  bench::add_options(*codec, codec_settings);

  CLI::App* gather = command("gather", "cost of a shaded sample by shape, size and path", kGatherFooter);
  bench::GatherStudySettings gather_settings;
  bench::add_options(*gather, gather_settings);

  CLI::App* layouts =
      command("layouts", "error by samples and bits by error of every atlas layout", kLayoutsFooter);
  bench::LayoutStudySettings layout_settings = bench::default_layout_study_settings();
  bench::add_options(*layouts, layout_settings);

  CLI::App* stability =
      command("stability", "extreme geometry and sampling, with the error of each case", kStabilityFooter);
  bench::StabilitySettings stability_settings;
  bench::add_options(*stability, stability_settings);

  CLI::App* report = app.add_subcommand("report", "one page from all runs in a folder");
  std::string folder;
  report->add_option("folder", folder, "where `loopback --report` or `stability --json` left its runs")
      ->required()
      ->check(CLI::ExistingDirectory);
  report->footer("Example:\n  tessera-bench report report");

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kOk : kUsage;
  }
  init_logging(log_level);
  if (loopback->parsed()) return run_loopback(settings);
  if (memory->parsed()) return run_memory(memory_settings);
  if (culling->parsed()) return run_culling(culling_settings);
  if (codec->parsed()) return run_codec(codec_settings);
  if (gather->parsed()) return run_gather(gather_settings);
  if (layouts->parsed()) return run_layouts(layout_settings);
  if (stability->parsed()) return run_stability(stability_settings);
  return spatial->parsed() ? run_spatial(spatial_settings) : run_report(folder);
}
