#include "bench/report_page.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <vector>

#include "base/frame_record.h"
#include "base/status.h"
#include "bench/html.h"
#include "bench/image_io.h"
#include "bench/report_plots.h"
#include "bench/stability_page.h"

namespace tessera::bench {
namespace {

using nlohmann::json;

std::string number(const json& object, const char* field, int decimals, double scale = 1) {
  if (!object.contains(field) || !object[field].is_number()) return "–";
  return absl::StrFormat("%.*f", decimals, object[field].get<double>() * scale);
}

struct Column {
  const char* title;
  const char* field;
  int decimals;
  double scale = 1;
};

constexpr Column kColumns[] = {{"MSSIM", "mssim", 4},
                               {"DSSIM", "dssim", 4},
                               {"PSNR dB", "psnr", 2},
                               {"PSNR RGB", "psnr_rgb", 2},
                               {"SSIM 7×7", "ssim7", 4},
                               {"MSSIM at masked edges", "mssim_masked", 4},
                               {"ΔE00 at borders", "delta_e_borders", 2},
                               {"L∞", "linf", 3},
                               {"holes %", "holes", 3, 100},
                               {"coverage %", "coverage", 2, 100},
                               {"without prediction %", "coverage_without_prediction", 2, 100},
                               {"overest. %", "overestimation", 1, 100},
                               {"Mbit/s", "mbps_total", 2},
                               {"atlas", "mbps_atlas", 2},
                               {"meta", "mbps_meta", 2},
                               {"frames", "frames_displayed", 0},
                               {"stale", "frames_stale", 0},
                               {"lost", "frames_lost", 0},
                               {"violations", "violations", 0},
                               {"server frames/s", "server_fps", 1},
                               {"server ms", "server_ms", 1},
                               {"client ms", "client_ms", 1}};

// What no row has, e.g. masked edges in a scene without masked materials, is no column.
std::vector<Column> columns_of(const json& rows) {
  std::vector<Column> columns;
  for (const Column& column : kColumns) {
    const auto has = [&](const json& row) { return row.contains(column.field); };
    if (std::any_of(rows.begin(), rows.end(), has)) columns.push_back(column);
  }
  return columns;
}

std::string rows_table(const json& rows) {
  const std::vector<Column> columns = columns_of(rows);
  std::string html = "<div class=\"scroll\"><table><tr><th>method</th>";
  for (const Column& column : columns) absl::StrAppend(&html, "<th>", column.title, "</th>");
  html += "</tr>\n";
  for (const json& row : rows) {
    const std::string session = row.value("session", 0) ? absl::StrCat(" #", row["session"].get<int>()) : "";
    absl::StrAppend(&html, "<tr><td>", escape(row.at("method").get<std::string>()), session, "</td>");
    for (const Column& column : columns) {
      absl::StrAppend(&html, "<td>", number(row, column.field, column.decimals, column.scale), "</td>");
    }
    html += "</tr>\n";
  }
  html += "</table></div>\n";
  for (const json& row : rows) {
    if (!row.contains("note")) continue;
    absl::StrAppend(&html, "<p class=\"soft\">", escape(row.at("method").get<std::string>()), ": ",
                    escape(row["note"].get<std::string>()), "</p>\n");
  }
  return html;
}

// Of runs by the real clock: nothing else has durations that were measured.
std::string latency_table(const json& run) {
  if (run.at("settings").value("clock", "") != "real") return "";
  std::vector<std::string> names;
  for (const auto& [name, duration] : FrameDurations().named()) names.emplace_back(name);
  std::string html = "<h3>Latency: p50 / p99 in ms</h3>\n<div class=\"scroll\"><table><tr><th>session</th>";
  for (const std::string& name : names) absl::StrAppend(&html, "<th>", name, "</th>");
  html += "<th>end to end</th><th>overhead</th><th>largest tiling error</th></tr>\n";
  const auto cell = [](const json& of, const std::string& name) {
    const json p = of.value(name, json::object());
    return absl::StrCat("<td>", number(p, "p50", 2), " / ", number(p, "p99", 2), "</td>");
  };
  for (const json& row : run.at("rows")) {
    absl::StrAppend(&html, "<tr><td>", row.value("session", 0), "</td>");
    const json durations = row.value("durations_ms", json::object());
    for (const std::string& name : names) html += cell(durations, name);
    absl::StrAppend(&html, cell(row, "end_to_end_ms"), cell(row, "overhead_ms"), "<td>",
                    number(row, "tiling_error_ms_max", 3), "</td></tr>\n");
  }
  return html +
         "</table></div>\n<p class=\"soft\">Of the two decodings the one that ends last counts in the total. "
         "Overhead is what is neither rendering, coding, drawing, the network, nor waiting for the next "
         "frame's "
         "time.</p>\n";
}

std::string split_table(const json& split) {
  if (split.empty()) return "";
  double largest = 1e-9;
  for (const json& row : split) largest = std::max(largest, row.value("added", 0.0));
  std::string html =
      "<h3>Error by cause</h3>\n<table><tr><th>cause</th><th>MSSIM without it</th><th>PSNR dB</th><th>adds "
      "to 1 − MSSIM</th>"
      "<th></th></tr>\n";
  for (const json& row : split) {
    const double bar_rem = 12 * std::max(0.0, row.value("added", 0.0)) / largest;
    absl::StrAppend(&html, "<tr><td>", escape(row.at("cause").get<std::string>()), "</td><td>",
                    number(row, "mssim", 4), "</td><td>", number(row, "psnr", 2), "</td><td>",
                    number(row, "added", 4),
                    "</td><td style=\"text-align:left\"><span class=\"bar\" style=\"width:",
                    absl::StrFormat("%.2f", bar_rem), "rem\"></span></td></tr>\n");
  }
  return html + "</table>\n";
}

std::string plots_html(const std::vector<Plot>& plots) {
  std::string html = "<div class=\"plots\">\n";
  for (const Plot& plot : plots) {
    absl::StrAppend(&html, "<figure><figcaption>", escape(plot.title), "</figcaption>");
    if (plot.svg.empty()) {
      html +=
          "<p class=\"soft\">No plot: it needs the program gnuplot (Debian package gnuplot-nox) and "
          "data.</p>";
    } else {
      absl::StrAppend(&html, "<img alt=\"", escape(plot.title), "\" src=\"",
                      data_uri("image/svg+xml", plot.svg), "\">");
    }
    html += "</figure>\n";
  }
  return html + "</div>\n";
}

// JPEG keeps the page small; the lossless files lie beside it.
std::string picture_html(const std::filesystem::path& folder, const std::string& file,
                         const std::string& caption) {
  const auto image = read_png(folder / std::filesystem::path(file).filename());
  if (!image.ok()) return absl::StrCat("<p class=\"soft\">", escape(image.status().message()), "</p>");
  return figure_html(*image, caption);
}

std::string pictures_html(const std::filesystem::path& folder, const json& pictures) {
  if (pictures.empty()) return "";
  const std::vector<uint8_t> legend = encode_png(dssim_legend(160, 10));
  std::string html = absl::StrCat(
      "<h3>Pictures</h3>\n<p class=\"soft\">DSSIM from 0 <img style=\"display:inline\" alt=\"colours of the "
      "DSSIM map\" src=\"",
      data_uri("image/png", absl::string_view(reinterpret_cast<const char*>(legend.data()), legend.size())),
      "\"> to ", absl::StrFormat("%.2f", kDssimFullScale), " and above.</p>\n");
  for (const json& picture : pictures) {
    const std::string note = picture.value("note", std::string());
    absl::StrAppend(&html, "<p><b>", escape(picture.at("label").get<std::string>()), "</b>, display frame ",
                    picture.value("display_frame", 0), note.empty() ? "" : ", ", escape(note), ", MSSIM ",
                    number(picture, "mssim", 4), "</p>\n<div class=\"triple\">\n");
    html += picture_html(folder, picture.at("truth").get<std::string>(), "truth");
    html += picture_html(folder, picture.at("shown").get<std::string>(), "client");
    html += picture_html(folder, picture.at("dssim").get<std::string>(), "DSSIM");
    html += "</div>\n";
  }
  return html;
}

std::string details(absl::string_view title, absl::string_view text) {
  if (text.empty()) return "";
  return absl::StrCat("<details><summary>", title, "</summary><pre>", escape(text), "</pre></details>\n");
}

std::string settings_text(const json& settings) {
  std::string text;
  for (const auto& [name, value] : settings.items()) {
    absl::StrAppend(&text, name, " = ", value.is_string() ? value.get<std::string>() : value.dump(), "\n");
  }
  return text;
}

std::string title_of(const json& run) {
  const json& s = run.at("settings");
  return absl::StrCat(
      std::filesystem::path(s.at("scene").get<std::string>()).stem().string(), ", ",
      s.at("size").get<std::string>(), ", atlas ", s.at("atlas").get<std::string>(), ", ",
      number(s, "bitrate-mbps", 1), " Mbit/s, ",
      s.value("clock", "") == "real" ? "real clock" : number(s, "delay-ms", 0) + " ms each way", ", codec ",
      s.at("codec").get<std::string>());
}

std::string run_html(const std::filesystem::path& folder, const json& run) {
  const json &device = run.at("device"), &machine = run.at("machine");
  std::string html = absl::StrCat(
      "<h2>", escape(title_of(run)), "</h2>\n<p><code>", escape(run.value("command", std::string())),
      "</code></p>\n<p class=\"soft\">commit ", escape(run.value("commit", std::string())), " · ",
      escape(device.value("name", std::string())), " (", escape(device.value("driver", std::string())),
      ") · ", escape(machine.value("cpu", std::string())), ", ", machine.value("cores", 0), " cores</p>\n");
  html += rows_table(run.at("rows"));
  html += latency_table(run);
  for (const json& note : run.value("notes", json::array())) {
    absl::StrAppend(&html, "<p class=\"soft\">", escape(note.get<std::string>()), "</p>\n");
  }
  html += split_table(run.at("split"));
  html += plots_html(plot_run(run));
  html += pictures_html(folder, run.value("pictures", json::array()));
  html += details("Settings", settings_text(run.at("settings")));
  html += details("Frame plan", run.value("plan", std::string()));
  return html;
}

}  // namespace

std::string report_page(const std::filesystem::path& folder, std::span<const json> runs) {
  std::vector<json> loopback, stability;
  for (const json& run : runs) (is_stability_run(run) ? stability : loopback).push_back(run);
  std::string html = page_head("Tessera: measured runs");
  if (!loopback.empty()) {
    html +=
        "<p class=\"soft\">The client's views beside the forward reference renderer. Means are over "
        "displayed "
        "frames.</p>\n";
    html += plots_html(plot_comparison(loopback));
  }
  for (const json& run : loopback) html += run_html(folder, run);
  for (const json& run : stability) html += stability_html(run);
  return html + "</body>\n</html>\n";
}

}  // namespace tessera::bench
