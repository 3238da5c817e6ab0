#include "bench/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <nlohmann/json.hpp>

#include "bench/file_io.h"
#include "bench/image_io.h"
#include "bench/report_plots.h"
#include "bench/stability.h"
#include "bench/temporary_folder.h"
#include "sample_result.h"

namespace tessera::bench {
namespace {

using testing::HasSubstr;
using testing::Not;

std::string page(const std::filesystem::path& folder) {
  const auto bytes = read_file(folder / "index.html");
  return bytes.ok() ? std::string(bytes->begin(), bytes->end()) : bytes.status().ToString();
}

size_t count(const std::string& text, const std::string& part) {
  size_t n = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + part.size())) ++n;
  return n;
}

// Restores PATH with the object.
class WithoutPrograms {
 public:
  WithoutPrograms() : path_(getenv("PATH")) { setenv("PATH", "/nonexistent", 1); }
  ~WithoutPrograms() { setenv("PATH", path_.c_str(), 1); }

 private:
  std::string path_;
};

TEST(Report, OnePageWithTablesPicturesAndCauses) {
  const TemporaryFolder folder;
  const auto file = write_run(folder.path(), sample_result());
  ASSERT_TRUE(file.ok()) << file.status();
  ASSERT_TRUE(write_report(folder.path()).ok());
  const std::string html = page(folder.path());
  EXPECT_THAT(html, HasSubstr("<td>tessera</td><td>0.9600</td>"));
  EXPECT_THAT(html, HasSubstr("<td>mesh-warp</td><td>0.9000</td>"));
  EXPECT_THAT(html, HasSubstr("<td>sampling</td><td>0.9800</td>"));
  EXPECT_THAT(html, HasSubstr("depth is not counted"));
  EXPECT_THAT(html, HasSubstr("1 directional light"));
  EXPECT_EQ(count(html, "data:image/jpeg;base64,"), 9u);  // three triples
  EXPECT_THAT(html, HasSubstr("MSSIM at masked edges"));
  EXPECT_THAT(html, HasSubstr("<td>0.8765</td>"));
  EXPECT_THAT(html, HasSubstr("enlarged twice"));
  EXPECT_EQ(count(html, "<h2>"), 1u);
}

StabilityResult sample_stability() {
  StabilityResult result{.command = "tessera-bench stability"};
  StabilityRow row{
      .of = {.group = "geometry", .name = "sliver", .input = "thin & long", .expected = "", .run = {}}};
  row.measures = {{"colour, blocks", 0.25, 0.5, "rounding"}, {"holes, blocks", NAN, 0, "none"}};
  result.rows = {row};
  return result;
}

TEST(Report, TheStabilityCatalogueHasATableOfItsOwn) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_file(folder.path() / "stability.json", to_json(sample_stability()).dump()).ok());
  ASSERT_TRUE(write_report(folder.path()).ok());
  const std::string alone = page(folder.path());
  EXPECT_THAT(alone,
              HasSubstr("<td>colour, blocks</td><td>0.25</td><td>0.5</td><td>rounding</td><td>pass</td>"));
  EXPECT_THAT(alone, HasSubstr("<td>not a number</td>"));
  EXPECT_THAT(alone, HasSubstr("thin &amp; long"));
  EXPECT_EQ(count(alone, "<b>FAIL</b>"), 3u) << "the measure, the case and the whole";

  ASSERT_TRUE(write_run(folder.path(), sample_result()).ok());
  ASSERT_TRUE(write_report(folder.path()).ok());
  EXPECT_EQ(count(page(folder.path()), "<h2>"), 2u);
}

TEST(Report, ASceneWithoutMaskedMaterialsHasNoSuchColumn) {
  const TemporaryFolder folder;
  LoopbackResult result = sample_result();
  result.rows[0].mssim_masked.reset();
  ASSERT_TRUE(write_run(folder.path(), result).ok());
  ASSERT_TRUE(write_report(folder.path()).ok());
  EXPECT_THAT(page(folder.path()), Not(HasSubstr("masked edges")));
}

TEST(Report, LatencyIsShownOfRunsByTheRealClockOnly) {
  const TemporaryFolder folder;
  LoopbackResult result = sample_result();
  ASSERT_TRUE(write_run(folder.path(), result).ok());
  ASSERT_TRUE(write_report(folder.path()).ok());
  EXPECT_THAT(page(folder.path()), Not(HasSubstr("tiling error")));
  result.settings.clock = "real";
  result.rows[0].overhead_ms = {0.25, 0.5, 0.75};
  ASSERT_TRUE(write_run(folder.path(), result).ok());
  ASSERT_TRUE(write_report(folder.path()).ok());
  const std::string html = page(folder.path());
  EXPECT_EQ(count(html, "tiling error"), 1u);
  for (const auto& [name, duration] : FrameDurations().named())
    EXPECT_THAT(html, HasSubstr(absl::StrCat("<th>", std::string(name), "</th>")));
  EXPECT_THAT(html, HasSubstr("<td>60.00 / 80.00</td>")) << "downlink";
  EXPECT_THAT(html, HasSubstr("<td>0.25 / 0.75</td>")) << "overhead";
}

TEST(Report, IsSelfContainedAndEscaped) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_run(folder.path(), sample_result()).ok());
  ASSERT_TRUE(write_report(folder.path()).ok());
  const std::string html = page(folder.path());
  EXPECT_THAT(html, Not(HasSubstr("<garden>")));
  EXPECT_THAT(html, HasSubstr("hall &amp; &lt;garden&gt;"));
  EXPECT_THAT(html, Not(HasSubstr("src=\"http")));
  EXPECT_EQ(count(html, "src=\""), count(html, "src=\"data:"));
}

TEST(Report, MergesRunsAndReplacesTheSameOne) {
  const TemporaryFolder folder;
  LoopbackResult result = sample_result();
  ASSERT_TRUE(write_run(folder.path(), result).ok());
  result.settings.report = "elsewhere";  // not a measured setting
  ASSERT_TRUE(write_run(folder.path(), result).ok());
  result.settings.delay_ms = 100;
  ASSERT_TRUE(write_run(folder.path(), result).ok());
  ASSERT_TRUE(write_file(folder.path() / "foreign.json", "{\"schema\": 3}").ok());
  ASSERT_TRUE(write_file(folder.path() / "broken.json", "{").ok());
  ASSERT_TRUE(write_report(folder.path()).ok());
  EXPECT_EQ(count(page(folder.path()), "<h2>"), 2u);
}

TEST(Report, PicturesLieBesideThePageWithoutLoss) {
  const TemporaryFolder folder;
  const LoopbackResult result = sample_result();
  const auto file = write_run(folder.path(), result);
  ASSERT_TRUE(file.ok());
  const auto run = nlohmann::json::parse(*read_file(*file));
  const auto truth = read_png(folder.path() / run["pictures"][0]["truth"].get<std::string>());
  ASSERT_TRUE(truth.ok()) << truth.status();
  EXPECT_EQ(truth->rgba, result.pictures[0].truth.rgba);
}

TEST(Report, AnEmptyFolderIsAnError) {
  const TemporaryFolder folder;
  EXPECT_THAT(write_report(folder.path()).ToString(), HasSubstr("loopback --report"));
}

TEST(Report, ARunThatLacksFieldsIsAnErrorNotACrash) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_file(folder.path() / "a.json", "{\"schema\": \"tessera.bench.v1\"}").ok());
  EXPECT_EQ(write_report(folder.path()).code(), absl::StatusCode::kInvalidArgument);
}

TEST(Report, WithoutGnuplotThePageSaysSo) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_run(folder.path(), sample_result()).ok());
  const WithoutPrograms none;
  ASSERT_TRUE(write_report(folder.path()).ok());
  const std::string html = page(folder.path());
  EXPECT_THAT(html, HasSubstr("gnuplot-nox"));
  EXPECT_EQ(count(html, "image/svg+xml"), 0u);
  EXPECT_THAT(html, HasSubstr("<td>tessera</td>"));
}

TEST(Report, PlotsAreDrawn) {
  if (draw_svg("plot x\n").empty()) GTEST_SKIP() << "gnuplot is not installed";
  const nlohmann::json run = to_json(sample_result());
  const auto plots = plot_run(run);
  EXPECT_EQ(plots.size(), 5u);
  for (const Plot& plot : plots) EXPECT_THAT(plot.svg, HasSubstr("<svg")) << plot.title;
  EXPECT_THAT(plots[0].svg, HasSubstr("mesh-warp"));
  for (const Plot& plot : plot_comparison(std::vector{run}))
    EXPECT_THAT(plot.svg, HasSubstr("<svg")) << plot.title;
  EXPECT_EQ(draw_svg("plot nonsense(\n"), "");
}

}  // namespace
}  // namespace tessera::bench
