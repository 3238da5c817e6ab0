#include "bench/html.h"

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/substitute.h"
#include "bench/image_io.h"

namespace tessera::bench {
namespace {

constexpr char kHead[] = R"(<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>$0</title>
<style>
:root { color-scheme: light dark; --text: #1d2329; --soft: #5b6670; --line: #d9dee3; --back: #ffffff; --bar: #0072b2; }
@media (prefers-color-scheme: dark) {
  :root { --text: #e4e8ec; --soft: #9aa5b0; --line: #39424b; --back: #14181c; --bar: #56b4e9; }
}
body { font: 15px/1.5 system-ui, sans-serif; color: var(--text); background: var(--back); max-width: 78rem; margin: 2rem auto; padding: 0 1rem; }
h1, h2, h3 { line-height: 1.2; } h2 { margin-top: 3rem; border-top: 1px solid var(--line); padding-top: 1.5rem; }
.soft, figcaption { color: var(--soft); font-size: 0.9em; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; margin: 1rem 0; font-variant-numeric: tabular-nums; }
th, td { padding: 0.25rem 0.7rem; text-align: right; border-bottom: 1px solid var(--line); white-space: nowrap; }
th:first-child, td:first-child { text-align: left; }
th { font-weight: 600; color: var(--soft); }
.bar { display: inline-block; height: 0.7em; background: var(--bar); }
.plots { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(34rem, 100%), 1fr)); gap: 1rem; }
.triple { display: grid; grid-template-columns: repeat(3, 1fr); gap: 0.5rem; }
figure { margin: 0; } img { max-width: 100%; display: block; border-radius: 4px; }
.plots img { background: #fcfcfd; width: 100%; }
code, pre { font-size: 0.88em; overflow-wrap: anywhere; white-space: pre-wrap; }
</style>
</head>
<body>
<h1>$0</h1>
)";

}  // namespace

std::string page_head(absl::string_view title) {
  return absl::Substitute(kHead, escape(title));
}

std::string escape(absl::string_view text) {
  std::string safe;
  for (const char c : text) {
    switch (c) {
      case '&':
        safe += "&amp;";
        break;
      case '<':
        safe += "&lt;";
        break;
      case '>':
        safe += "&gt;";
        break;
      case '"':
        safe += "&quot;";
        break;
      default:
        safe += c;
    }
  }
  return safe;
}

std::string data_uri(absl::string_view type, absl::string_view bytes) {
  return absl::StrCat("data:", type, ";base64,", absl::Base64Escape(bytes));
}

std::string figure_html(const Image8& image, absl::string_view caption) {
  const std::vector<uint8_t> jpeg = encode_jpeg(image);
  const absl::string_view bytes(reinterpret_cast<const char*>(jpeg.data()), jpeg.size());
  return absl::StrCat("<figure><img alt=\"", escape(caption), "\" src=\"", data_uri("image/jpeg", bytes),
                      "\"><figcaption>", escape(caption), "</figcaption></figure>\n");
}

}  // namespace tessera::bench
