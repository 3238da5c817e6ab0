// Options, JSON, tables and the page of `tessera-bench gather`.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "absl/strings/str_join.h"
#include "bench/file_io.h"
#include "bench/gather_study.h"
#include "bench/html.h"
#include "bench/report_plots.h"

namespace tessera::bench {
namespace {

using nlohmann::json;

json to_json(const Spread& s) {
  return {{"p25", s.low}, {"p50", s.median}, {"p75", s.high}};
}

json to_json(const GatherRow& row) {
  json out = {{"group", row.group},
              {"name", row.name},
              {"path", row.path},
              {"size", row.size},
              {"samples", row.samples},
              {"ns_per_sample", to_json(row.ns)},
              {"ratio", to_json(row.ratio)},
              {"ratio_to_shading_pass", to_json(row.ratio_shading)},
              {"list_ms", to_json(row.list_ms)}};
  if (row.slant > 0) out["slant"] = row.slant;
  if (row.outside) out["outside"] = *row.outside;
  if (row.empty) out["empty"] = *row.empty;
  return out;
}

// By shape, size class and path.
json to_json(const shading::GatherCosts& costs) {
  json out;
  for (size_t shape = 0; shape < shading::kGatherShapes; ++shape)
    for (size_t path = 0; path < std::size(shading::kGatherPaths); ++path) {
      json by_class = json::array();
      for (const auto& ns : costs.ns[shape]) by_class.push_back(ns[path]);
      out[std::string(shading::kGatherShapeNames[shape])]
         [std::string(shading::name_of(shading::kGatherPaths[path]))] = by_class;
    }
  return out;
}

std::string note_of(const GatherRow& row) {
  if (row.group == "layouts") {
    const std::string lists = absl::StrFormat("lists %.2f ms", row.list_ms.median);
    return row.outside ? absl::StrFormat("%s, %.1f%% outside", lists, 100 * *row.outside) : lists;
  }
  if (row.outside) return absl::StrFormat("%.1f%% outside", 100 * *row.outside);
  return row.empty ? absl::StrFormat("%.1f%% of the tiles empty", 100 * *row.empty) : "";
}

std::string cell(const Spread& s) {
  return absl::StrFormat("%.2f (%.2f-%.2f)", s.median, s.low, s.high);
}

std::string summary(const GatherStudyResult& r) {
  return absl::StrFormat(
      "forward: %s ns a covered pixel, of which %s are its shading pass and the rest its depth pass; %.0f%% "
      "of "
      "the picture are covered, %.1f%% by masked materials, which the loads leave out\n",
      cell(r.forward_ns), cell(r.shading_ns), 100 * r.covered, 100 * r.masked);
}

std::string texel_summary(const GatherStudyResult& r) {
  return absl::StrFormat(
      "texel shading of the whole picture: %d tiles, %d texels that show something; %.1f texels a metre\n",
      r.texel_tiles, r.texel_samples, r.texels_per_metre);
}

std::string costs_summary(const GatherStudyResult& r) {
  return absl::StrFormat(
      "cost model: measured in %.0f ms: %s\n            shipped for software devices: %s\n", r.costs_ms,
      r.measured_choice, r.software_choice);
}

std::string table_html(const std::vector<GatherRow>& rows) {
  std::string html =
      "<div class=\"scroll\"><table>\n<tr><th>load</th><th>path</th><th>samples</th><th>ns a sample</th>"
      "<th>to forward</th><th>to its shading pass</th><th></th></tr>\n";
  for (const GatherRow& row : rows)
    absl::StrAppend(&html, "<tr><td>", escape(row.group), " ", escape(row.name), "</td><td>", row.path,
                    "</td><td>", row.samples, "</td><td>", cell(row.ns), "</td><td>", cell(row.ratio),
                    "</td><td>", cell(row.ratio_shading), "</td><td>", note_of(row), "</td></tr>\n");
  return html + "</table></div>\n";
}

// Ratio to forward by size, a line a path with its quartiles.
std::string plot(const GatherStudyResult& result, const std::string& group, const std::string& x_label) {
  std::map<std::string, std::string> blocks;
  for (const GatherRow& row : result.rows)
    if (row.group == group)
      absl::StrAppend(
          &blocks[row.slant > 0 ? absl::StrFormat("%s, slant %g", row.path, row.slant) : row.path],
          absl::StrFormat("%g %g %g %g\n", row.size, row.ratio.median, row.ratio.low, row.ratio.high));
  if (blocks.empty()) return "";
  std::string script = absl::StrCat(
      "set border 3\nset tics nomirror\nset grid ytics\nset key outside right noenhanced\nset logscale x "
      "2\nset "
      "logscale y 2\nset xlabel '",
      x_label, "'\nset ylabel 'time of a sample, forward = 1'\n");
  std::string curves;
  size_t i = 0;
  for (const auto& [path, data] : blocks) {
    absl::StrAppend(&script, "$d", i, " << EOD\n", data, "EOD\n");
    absl::StrAppend(&curves, curves.empty() ? "plot " : ", ", "$d", i,
                    " using 1:2:3:4 with yerrorlines title '", path, "'");
    ++i;
  }
  const std::string svg = draw_svg(script + curves + ", 1 dashtype 2 lc rgb '#888888' notitle\n");
  return svg.empty() ? ""
                     : absl::StrCat("<figure><img alt=\"", group, "\" src=\"", data_uri("image/svg+xml", svg),
                                    "\"><figcaption>", group, "</figcaption></figure>\n");
}

template <class T>
CLI::Option* add_number(CLI::App& app, const char* name, const char* variable, T& field, const char* meaning,
                        double low, double high) {
  return app.add_option(name, field, meaning)
      ->check(CLI::Range(low, high))
      ->group("Gather")
      ->envname(variable)
      ->capture_default_str();
}

}  // namespace

void add_options(CLI::App& app, GatherStudySettings& settings) {
  const std::vector<std::string> common = {"scene", "path",   "start", "size",
                                           "fov-y", "device", "json",  "report"};
  add_options(app, settings.common, common);
  add_number(app, "--samples", "TESSERA_BENCH_SAMPLES", settings.samples, "of each load, about", 1000, 2e6);
  add_number(app, "--rounds", "TESSERA_BENCH_ROUNDS", settings.rounds, "that count, after one that warms up",
             1, 1000);
  add_number(app, "--texture-mtexels", "TESSERA_BENCH_TEXTURE_MTEXELS", settings.texture_mtexels,
             "texel shading: size of its texture's finest level in Mi texels", 1, 256);
  std::vector<std::string> groups;
  for (const std::string_view group : kGatherGroups) groups.emplace_back(group);
  app.add_option("--groups", settings.groups, "which loads to measure; default: all")
      ->check(CLI::IsMember(groups))
      ->delimiter(',')
      ->group("Gather")
      ->envname("TESSERA_BENCH_GROUPS");
}

std::vector<std::string> to_flags(const GatherStudySettings& settings) {
  std::vector<std::string> flags = to_flags(settings.common, GatherStudySettings().common);
  flags.push_back(absl::StrCat("--samples=", settings.samples));
  flags.push_back(absl::StrCat("--rounds=", settings.rounds));
  flags.push_back(absl::StrCat("--texture-mtexels=", settings.texture_mtexels));
  if (!settings.groups.empty()) flags.push_back("--groups=" + absl::StrJoin(settings.groups, ","));
  return flags;
}

json to_json(const GatherStudyResult& result) {
  json run = run_json(result.command, result.device, result.settings.common);
  json& settings = run["settings"];
  settings["samples"] = result.settings.samples;
  settings["rounds"] = result.settings.rounds;
  settings["texture-mtexels"] = result.settings.texture_mtexels;
  settings["groups"] = result.settings.groups;
  run["forward"] = {{"ns_per_pixel", to_json(result.forward_ns)},
                    {"shading_pass_ns_per_pixel", to_json(result.shading_ns)},
                    {"covered", result.covered},
                    {"masked", result.masked}};
  run["rows"] = json::array();
  for (const GatherRow& row : result.rows) run["rows"].push_back(to_json(row));
  if (result.texel_tiles > 0)
    run["texel_shading"] = {{"tiles", result.texel_tiles},
                            {"samples", result.texel_samples},
                            {"texels_per_metre", result.texels_per_metre}};
  if (result.costs_ms > 0)
    run["costs"] = {{"ns_per_sample", to_json(result.costs)},
                    {"ms", result.costs_ms},
                    {"measured", result.measured_choice},
                    {"software", result.software_choice}};
  return run;
}

std::string to_text(const GatherStudyResult& result) {
  std::string text = absl::StrFormat("%-8s %-14s %-12s %9s %22s %20s %20s\n", "group", "load", "path",
                                     "samples", "ns a sample", "to forward", "to its shading pass");
  for (const GatherRow& row : result.rows)
    absl::StrAppendFormat(&text, "%-8s %-14s %-12s %9d %22s %20s %20s  %s\n", row.group, row.name, row.path,
                          row.samples, cell(row.ns), cell(row.ratio), cell(row.ratio_shading), note_of(row));
  absl::StrAppend(&text, "(median, quartiles of the rounds)\n", summary(result));
  if (result.texel_tiles > 0) text += texel_summary(result);
  if (result.costs_ms > 0) text += costs_summary(result);
  return text;
}

Status write_gather_report(const std::string& folder, const GatherStudyResult& result) {
  std::string html = page_head("Tessera: cost of a shaded sample");
  absl::StrAppend(&html, "<p><code>", escape(result.command), "</code></p>\n<p class=\"soft\">",
                  escape(result.device.name), " (", escape(result.device.driver), "). ",
                  escape(summary(result)), " Shadow maps are in neither. Medians and quartiles of ",
                  result.settings.rounds, " interleaved rounds.</p>\n<div class=\"plots\">\n",
                  plot(result, "blocks", "side of a block, texels"), plot(result, "l", "level of an L"),
                  plot(result, "halves", "intervals across a half"), "</div>\n", table_html(result.rows));
  if (result.texel_tiles > 0) absl::StrAppend(&html, "<p>", escape(texel_summary(result)), "</p>\n");
  if (result.costs_ms > 0) absl::StrAppend(&html, "<p>", escape(costs_summary(result)), "</p>\n");
  TESSERA_RETURN_IF_ERROR(
      write_file(std::filesystem::path(folder) / "gather.json", to_json(result).dump(1) + "\n"));
  return write_file(std::filesystem::path(folder) / "gather.html", html + "</body>\n</html>\n");
}

}  // namespace tessera::bench
