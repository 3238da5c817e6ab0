// The page of `tessera-bench layouts`.
#include <filesystem>
#include <nlohmann/json.hpp>

#include "absl/strings/str_replace.h"
#include "bench/file_io.h"
#include "bench/html.h"
#include "bench/image_io.h"
#include "bench/layout_study.h"
#include "bench/report_plots.h"

namespace tessera::bench {
namespace {

// A curve a layout; `point` gives x and y, or nothing for rows that do not count.
template <class PointOf>
std::string plot(const LayoutStudyResult& result, const char* x, PointOf point) {
  std::string data, curves;
  int count = 0;
  for (const std::string& layout : result.settings.layouts) {
    const std::string block = absl::StrCat("$data", count++);
    absl::StrAppend(&data, block, " << EOD\n");
    for (const LayoutRow& row : result.rows) {
      if (row.layout != layout) continue;
      if (const std::optional<Point> p = point(row)) absl::StrAppendFormat(&data, "%g %g\n", p->x, p->y);
    }
    absl::StrAppend(&data, "EOD\n");
    absl::StrAppend(&curves, curves.empty() ? "plot " : ", ", block,
                    " using 1:2 with linespoints lw 2 pt 7 title '", layout, "'");
  }
  return draw_svg(absl::StrCat("set logscale x 2\nset grid\nset yrange [0:*]\nset xlabel '", x,
                               "'\nset ylabel 'DSSIM'\n", data, curves, "\n"));
}

std::string plots_html(const LayoutStudyResult& result) {
  std::string html = plot(result, "million samples a frame", [](const LayoutRow& row) {
    return std::optional(Point{1e-6 * row.samples, row.error.dssim()});
  });
  if (result.settings.bitrates_mbps.empty()) return html;
  return html + plot(result, "kbit a frame, atlas and meta", [](const LayoutRow& row) {
           return row.coded ? std::optional(Point{row.atlas_kbit + row.meta_kbit, row.coded->dssim()})
                            : std::nullopt;
         });
}

StatusOr<std::string> picture_html(const std::filesystem::path& folder, const LayoutPicture& picture) {
  const std::string stem = "layouts-" + absl::StrReplaceAll(picture.name, {{", ", "-"}});
  std::string html = absl::StrCat("<h3>", escape(picture.name), "</h3>\n<p class=\"soft\">MSSIM ",
                                  absl::StrFormat("%.4f", picture.mssim), "</p>\n<div class=\"triple\">\n");
  const std::pair<const char*, const Image8*> images[] = {
      {"client", &picture.shown}, {"dssim", &picture.dssim}, {"atlas", &picture.atlas}};
  for (const auto& [kind, image] : images) {
    if (image->rgba.empty()) continue;
    TESSERA_RETURN_IF_ERROR(write_png(folder / (stem + "-" + kind + ".png"), *image));
    html += figure_html(*image, kind);
  }
  return html + "</div>\n";
}

}  // namespace

Status write_layout_report(const std::string& folder, const LayoutStudyResult& result) {
  std::string html = page_head("Tessera: atlas layouts");
  absl::StrAppend(&html, "<p><code>", escape(result.command), "</code></p>\n<p class=\"soft\">",
                  escape(result.device.name), " (", escape(result.device.driver), "), ", result.frames,
                  " pictures a row. Errors by samples are before coding.</p>\n", plots_html(result), "<pre>",
                  escape(to_text(result)), "</pre>\n<h2>Pictures</h2>\n");
  for (const LayoutPicture& picture : result.pictures) {
    TESSERA_ASSIGN_OR_RETURN(const std::string part, picture_html(folder, picture));
    html += part;
  }
  if (!result.pictures.empty()) html += "<h3>Truth</h3>\n" + figure_html(result.pictures[0].truth, "truth");
  const std::filesystem::path out(folder);
  TESSERA_RETURN_IF_ERROR(write_file(out / "layouts.json", to_json(result).dump(1) + "\n"));
  return write_file(out / "layouts.html", html + "</body>\n</html>\n");
}

}  // namespace tessera::bench
