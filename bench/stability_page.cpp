#include "bench/stability_page.h"

#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "bench/html.h"

namespace tessera::bench {
namespace {

using nlohmann::json;

std::string text(const json& object, const char* field) {
  return escape(object.value(field, std::string()));
}

// NaN is null in JSON.
std::string number(const json& object, const char* field) {
  const auto found = object.find(field);
  if (found == object.end() || !found->is_number()) return "not a number";
  return absl::StrFormat("%.3g", found->get<double>());
}

std::string verdict(const json& object) {
  return object.value("passed", false) ? "pass" : "<b>FAIL</b>";
}

std::string case_rows(const json& of) {
  const json measures = of.value("measures", json::array());
  std::string html =
      absl::StrCat("<tr><td><b>", text(of, "case"), "</b> (", text(of, "group"),
                   ")</td><td colspan=\"4\" style=\"text-align:left\">", text(of, "input"),
                   "; expected: ", text(of, "expected"), "</td><td>", verdict(of), "</td></tr>\n");
  if (of.contains("failure"))
    absl::StrAppend(&html, "<tr><td></td><td colspan=\"5\">", text(of, "failure"), "</td></tr>\n");
  for (const json& m : measures)
    absl::StrAppend(&html, "<tr><td></td><td>", text(m, "what"), "</td><td>", number(m, "error"), "</td><td>",
                    number(m, "bound"), "</td><td>", text(m, "why"), "</td><td>", verdict(m), "</td></tr>\n");
  return html;
}

}  // namespace

bool is_stability_run(const json& run) {
  return run.contains("stability");
}

std::string stability_html(const json& run) {
  std::string html = absl::StrCat(
      "<h2>Stability catalogue: ", verdict(run), "</h2>\n<p><code>", text(run, "command"),
      "</code></p>\n<p class=\"soft\">commit ", text(run, "commit"), " · ",
      text(run.value("device", json::object()), "name"),
      "</p>\n<div "
      "class=\"scroll\"><table><tr><th>case</th><th>measure</th><th>error</th><th>bound</th><th>why"
      "</th><th></th></tr>\n");
  for (const json& of : run.at("stability")) html += case_rows(of);
  return html + "</table></div>\n";
}

}  // namespace tessera::bench
