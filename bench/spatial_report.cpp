// The page of `tessera-bench spatial`.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "absl/strings/str_replace.h"
#include "bench/file_io.h"
#include "bench/html.h"
#include "bench/image_io.h"
#include "bench/spatial.h"

namespace tessera::bench {
namespace {

constexpr double kLeastLog = -6, kMostLog = 2;  // of samples per pixel, binary

std::string table_html(const std::vector<SpatialRow>& rows) {
  std::string html =
      "<div class=\"scroll\"><table>\n<tr><th>method</th><th>bias</th><th>samples</th><th>per pixel</th>"
      "<th>saved %</th><th>to mono</th><th>mean bias</th><th>MSSIM</th><th>within 5°</th><th>holes %</th>"
      "<th>out of memory</th><th>visibility ms</th><th>density ms</th><th>layout ms</th><th>shading "
      "ms</th></tr>\n";
  for (const SpatialRow& row : rows) {
    absl::StrAppend(
        &html, "<tr><td>", escape(row.method.name), "</td><td>", row.method.bias_name(), "</td><td>",
        absl::StrFormat("%.0f</td><td>%.3f</td><td>%.1f</td><td>%.3f</td><td>%.2f</td><td>%.4f</td><td>%.4f</"
                        "td><td>%.4f</td><td>%.1f</td><td>%.1f</td><td>%.2f</td><td>%.2f</td><td>%.1f",
                        row.samples, row.per_pixel, 100 * (1 - row.per_pixel), row.to_mono, row.bias,
                        row.mssim, row.mssim_center, 100 * row.holes, row.out_of_memory, row.visibility_ms,
                        row.density_ms, row.layout_ms, row.shading_ms),
        "</td></tr>\n");
  }
  return html + "</table></div>\n";
}

std::string file_stem(const std::string& name) {
  return "spatial-" + absl::StrReplaceAll(name, {{", ", "-"}, {" ", "-"}, {".", "_"}});
}

StatusOr<std::string> picture_html(const std::filesystem::path& folder, const SpatialPicture& picture) {
  std::string html = absl::StrCat("<h3>", escape(picture.name), "</h3>\n<p class=\"soft\">MSSIM ",
                                  absl::StrFormat("%.4f", picture.mssim), "</p>\n<div class=\"triple\">\n");
  const std::pair<const char*, const Image8*> images[] = {
      {"client", &picture.shown}, {"dssim", &picture.dssim}, {"density", &picture.density}};
  for (const auto& [kind, image] : images) {
    TESSERA_RETURN_IF_ERROR(write_png(folder / (file_stem(picture.name) + "-" + kind + ".png"), *image));
    html += figure_html(*image, kind);
  }
  return html + "</div>\n";
}

}  // namespace

Image8 density_picture(const Plane& per_pixel) {
  Plane values(per_pixel.width, per_pixel.height);
  for (size_t i = 0; i < per_pixel.values.size(); ++i) {
    const double log = std::log2(std::max(per_pixel.values[i], 1e-6f));
    const double share = std::clamp((log - kLeastLog) / (kMostLog - kLeastLog), 0.0, 1.0);
    values.values[i] = static_cast<float>(1 - 2 * share);  // whose DSSIM is the share
  }
  return dssim_picture(values, 1);
}

Status write_spatial_report(const std::string& folder, const SpatialResult& result) {
  const LoopbackSettings& common = result.settings.common;
  std::string html = page_head("Tessera: spatial reuse");
  absl::StrAppend(&html, "<p><code>", escape(result.command), "</code></p>\n<p class=\"soft\">",
                  escape(result.device.name), " (", escape(result.device.driver), "), ", result.frames,
                  " frames of ", common.size.width, "x", common.size.height, " pixels an eye, atlas ",
                  common.atlas.width, "x", common.atlas.height,
                  ". Samples are shaded ones, per pixel of one eye's picture; bias off: levels follow the "
                  "screen alone. The gaze is straight ahead. Pictures have no coding error.</p>\n",
                  table_html(result.rows),
                  "<h2>Pictures of the middle frame</h2>\n<p class=\"soft\">DSSIM from 0 to ",
                  absl::StrFormat("%.2f", kDssimFullScale),
                  "; density from 1/64 (black) to 4 samples per pixel (pale yellow).</p>\n");
  for (const SpatialPicture& picture : result.pictures) {
    TESSERA_ASSIGN_OR_RETURN(const std::string part, picture_html(folder, picture));
    html += part;
  }
  if (!result.pictures.empty()) html += "<h3>Truth</h3>\n" + figure_html(result.pictures[0].truth, "mono");
  TESSERA_RETURN_IF_ERROR(
      write_file(std::filesystem::path(folder) / "spatial.json", to_json(result).dump(1) + "\n"));
  return write_file(std::filesystem::path(folder) / "spatial.html", html + "</body>\n</html>\n");
}

}  // namespace tessera::bench
