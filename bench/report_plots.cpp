#include "bench/report_plots.h"

#include <fcntl.h>
#include <spawn.h>
#include <stdlib.h>
#include <sys/wait.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>

#include "base/frame_record.h"
#include "base/status.h"
#include "bench/file_io.h"
#include "bench/temporary_folder.h"

extern char** environ;

namespace tessera::bench {
namespace {

using nlohmann::json;

constexpr double kBitrateBinS = 0.25;

struct Point {
  double x, y;
};
struct Series {
  std::string name;
  std::vector<Point> points;
  std::string method = name;  // decides the colour
  int symbol = 7;             // gnuplot's pointtype
};

// Inside gnuplot's single quotes; its enhanced-text characters are off.
std::string quoted(const std::string& text) {
  std::string safe = "'";
  for (const char c : text)
    safe += c == '\'' ? std::string("''") : c < ' ' ? std::string(" ") : std::string(1, c);
  return safe + "'";
}

// Colours that stay apart for colour-blind readers (Okabe and Ito).
std::string color_of(const std::string& name, size_t index) {
  static const std::map<std::string, std::string> kKnown{
      {"tessera", "#0072b2"}, {"mesh-warp", "#d55e00"}, {"plain-video", "#888888"}};
  static const char* const kOthers[] = {"#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9"};
  const auto known = kKnown.find(name);
  return known != kKnown.end() ? known->second : kOthers[index % std::size(kOthers)];
}

std::string frame_script(const std::string& x_label, const std::string& y_label) {
  return "set border 3 lc rgb '#555555'\nset tics nomirror\nset grid ytics lc rgb '#dddddd'\nset key outside "
         "right noenhanced\n"
         "set termoption noenhanced\nset xlabel " +
         quoted(x_label) + "\nset ylabel " + quoted(y_label) + "\n";
}

std::string data_block(size_t index, const std::vector<Point>& points) {
  std::string block = absl::StrFormat("$d%d << EOD\n", index);
  for (const Point& p : points) absl::StrAppendFormat(&block, "%.9g %.9g\n", p.x, p.y);
  return block + "EOD\n";
}

// `style` as in gnuplot's `with`, e.g. "lines lw 1.5".
std::string series_script(const std::vector<Series>& series, const std::string& style) {
  std::string blocks, plot;
  for (size_t i = 0; i < series.size(); ++i) {
    if (series[i].points.empty()) continue;
    blocks += data_block(i, series[i].points);
    const std::string symbol = style.starts_with("points") ? absl::StrCat(" pt ", series[i].symbol) : "";
    absl::StrAppendFormat(&plot, "%s $d%d using 1:2 with %s%s lc rgb '%s' title %s",
                          plot.empty() ? "plot" : ",", i, style, symbol, color_of(series[i].method, i),
                          quoted(series[i].name));
  }
  return plot.empty() ? "" : blocks + plot + "\n";
}

Plot draw(const std::string& title, const std::string& frame, const std::string& body) {
  return {title, body.empty() ? "" : draw_svg(frame + body)};
}

double seconds_of(const json& frame) {
  return frame.value("time_ns", 0.0) * 1e-9;
}

std::vector<Series> ssim_series(const json& frames) {
  std::map<std::string, std::vector<Point>> by_method;
  for (const json& frame : frames) {
    if (!frame.contains("mssim")) continue;
    for (const auto& [method, value] : frame["mssim"].items()) {
      by_method[method].push_back({seconds_of(frame), value.get<double>()});
    }
  }
  std::vector<Series> series;
  for (auto& [method, points] : by_method) series.push_back({method, std::move(points)});
  return series;
}

Series frame_series(const json& frames, const std::string& name, const char* field, double scale) {
  Series series{name, {}};
  for (const json& frame : frames)
    series.points.push_back({seconds_of(frame), frame.value(field, 0.0) * scale});
  return series;
}

Series bitrate_series(const json& frames, const std::string& name, const char* field) {
  std::map<int64_t, double> bytes;
  for (const json& frame : frames) {
    bytes[static_cast<int64_t>(std::floor(seconds_of(frame) / kBitrateBinS))] += frame.value(field, 0.0);
  }
  Series series{name, {}};
  for (const auto& [bin, sum] : bytes) {
    series.points.push_back({kBitrateBinS * static_cast<double>(bin), sum * 8e-6 / kBitrateBinS});
  }
  if (!series.points.empty()) {  // the last step has its width too
    series.points.push_back({series.points.back().x + kBitrateBinS, series.points.back().y});
  }
  return series;
}

std::string durations_script(const json& durations) {
  if (durations.empty()) return "";
  std::string block = "$d0 << EOD\n";
  for (const auto& [key, unused] : FrameDurations().named()) {
    const std::string name(key);
    const json p = durations.value(name, json::object());
    absl::StrAppendFormat(&block, "\"%s\" %.6g %.6g %.6g\n", name, p.value("p50", 0.0), p.value("p95", 0.0),
                          p.value("p99", 0.0));
  }
  return block +
         "EOD\nset style data histograms\nset style fill solid 0.9 noborder\nset boxwidth 0.9\nset yrange "
         "[0:*]\n"
         "set xtics rotate by -20\n"
         "plot $d0 using 2:xtic(1) lc rgb '#0072b2' title 'p50', '' using 3 lc rgb '#56b4e9' title 'p95', "
         "'' using 4 lc rgb '#cccccc' title 'p99'\n";
}

std::string scene_name(const json& run) {
  return std::filesystem::path(run.at("settings").value("scene", std::string("scene"))).stem();
}

// One series a row: colours tell methods apart, symbols runs.
std::vector<Series> comparison_series(std::span<const json> runs,
                                      const std::function<Point(const json&)>& point) {
  static constexpr int kSymbols[] = {7, 5, 9, 11, 13};  // filled circle, square, triangles, diamond
  std::vector<Series> series;
  for (size_t i = 0; i < runs.size(); ++i) {
    for (const json& row : runs[i].at("rows")) {
      const std::string method = row.value("method", std::string("?"));
      const std::string name = runs.size() > 1 ? method + ", " + scene_name(runs[i]) : method;
      series.push_back({name, {point(row)}, method, kSymbols[i % std::size(kSymbols)]});
    }
  }
  return series;
}

// True if gnuplot ran and found nothing to complain about.
bool run_gnuplot(const std::string& script_file) {
  std::string program = "gnuplot", file = script_file;
  char* const arguments[] = {program.data(), file.data(), nullptr};
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 2, "/dev/null", O_WRONLY, 0);
  pid_t child = 0;
  const int failed = posix_spawnp(&child, "gnuplot", &actions, nullptr, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  int status = 0;
  return !failed && waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

}  // namespace

std::string draw_svg(const std::string& script) {
  const TemporaryFolder folder;
  if (folder.path().empty()) return "";
  const auto script_file = folder.path() / "plot.gp", svg_file = folder.path() / "plot.svg";
  const std::string head =
      "set terminal svg size 760,280 font 'sans-serif,11'\nset output " + quoted(svg_file.string()) + "\n";
  if (!write_file(script_file, head + script).ok() || !run_gnuplot(script_file.string())) return "";
  const auto svg = read_file(svg_file);
  return svg.ok() ? std::string(svg->begin(), svg->end()) : "";
}

std::vector<Plot> plot_run(const json& run) {
  const json& frames = run.at("frames");
  const json& rows = run.at("rows");
  std::vector<Plot> plots;
  const std::string time = "time on the path, s";
  plots.push_back(draw("Structural similarity", frame_script(time, "mean SSIM"),
                       series_script(ssim_series(frames), "lines lw 1.5")));
  plots.push_back(draw("Bit rate", frame_script(time, "Mbit/s") + "set yrange [0:*]\n",
                       series_script({bitrate_series(frames, "atlas", "atlas_bytes"),
                                      bitrate_series(frames, "meta", "meta_bytes")},
                                     "steps lw 1.5")));
  plots.push_back(draw("Holes", frame_script(time, "share of pixels, %") + "set yrange [0:*]\n",
                       series_script({frame_series(frames, "holes", "holes", 100)}, "lines lw 1.5")));
  plots.push_back(draw("Age of the shown pose", frame_script(time, "ms") + "set yrange [0:*]\n",
                       series_script({frame_series(frames, "age", "age_ms", 1)}, "steps lw 1.5")));
  if (!rows.empty() && rows[0].contains("durations_ms")) {
    plots.push_back(
        draw("Durations of a round trip", frame_script("", "ms"), durations_script(rows[0]["durations_ms"])));
  }
  std::erase_if(plots, [&frames](const Plot& plot) {
    return frames.empty() && plot.title != "Durations of a round trip";
  });
  return plots;
}

std::vector<Plot> plot_comparison(std::span<const json> runs) {
  const auto time_point = [](const json& row) {
    return Point{row.value("server_ms", 0.0) + row.value("client_ms", 0.0), row.value("dssim", 0.0)};
  };
  const auto rate_point = [](const json& row) {
    return Point{row.value("mbps_total", 0.0), row.value("dssim", 0.0)};
  };
  const std::string from_zero =
      "set xrange [0:*]\nset yrange [0:*]\nset offsets graph 0.05, graph 0.05, graph 0.1, 0\n";
  std::vector<Plot> plots;
  plots.push_back(draw("Error against compute time",
                       frame_script("server and client, ms a frame", "DSSIM") + from_zero,
                       series_script(comparison_series(runs, time_point), "points ps 1.2")));
  plots.push_back(draw("Error against bit rate", frame_script("Mbit/s", "DSSIM") + from_zero,
                       series_script(comparison_series(runs, rate_point), "points ps 1.2")));
  return plots;
}

}  // namespace tessera::bench
