#include "bench/report.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/log.h"
#include "bench/file_io.h"
#include "bench/image_io.h"
#include "bench/report_page.h"

namespace tessera::bench {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// The same for the same measured settings, whatever files the results go to.
std::string run_name(const LoopbackSettings& settings) {
  LoopbackSettings measured = settings;
  measured.json.clear();
  measured.report.clear();
  measured.truth_cache.clear();
  measured.frames_csv.clear();
  measured.trace.clear();
  std::string scene = fs::path(settings.scene).stem().string();
  std::ranges::replace_if(
      scene, [](unsigned char c) { return !std::isalnum(c) && c != '-' && c != '_'; }, '_');
  return scene + "-" + fingerprint_hex(to_json(measured).dump()).substr(0, 8);
}

StatusOr<json> write_pictures(const fs::path& folder, const std::string& run,
                              const std::vector<Picture>& pictures) {
  json list = json::array();
  for (const Picture& picture : pictures) {
    const std::string stem = absl::StrCat(run, "-", picture.label, "-");
    json entry{{"label", picture.label}, {"display_frame", picture.display_frame}, {"mssim", picture.mssim}};
    if (!picture.note.empty()) entry["note"] = picture.note;
    const auto write = [&](const char* kind, const Image8& image) {
      entry[kind] = stem + kind + ".png";
      return write_png(folder / (stem + kind + ".png"), image);
    };
    TESSERA_RETURN_IF_ERROR(write("truth", picture.truth));
    TESSERA_RETURN_IF_ERROR(write("shown", picture.shown));
    TESSERA_RETURN_IF_ERROR(write("dssim", dssim_picture(picture.ssim)));
    list.push_back(std::move(entry));
  }
  return list;
}

// The run, or null if the file is something else.
json read_run(const fs::path& file) {
  const auto bytes = read_file(file);
  if (!bytes.ok()) return {};
  json run = json::parse(*bytes, nullptr, false);
  const bool ours = run.is_object() && run.contains("schema") && run["schema"] == kSchema;
  return ours ? run : json();
}

std::vector<json> read_runs(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().extension() == ".json") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  std::vector<json> runs;
  for (const fs::path& file : files) {
    json run = read_run(file);
    if (run.is_null()) {
      spdlog::warn("{}: skipped, it is not a {} file", file.string(), kSchema);
    } else {
      runs.push_back(std::move(run));
    }
  }
  return runs;
}

}  // namespace

StatusOr<fs::path> write_run(const fs::path& folder, const LoopbackResult& result) {
  const std::string name = run_name(result.settings);
  json run = to_json(result);
  TESSERA_ASSIGN_OR_RETURN(run["pictures"], write_pictures(folder, name, result.pictures));
  const fs::path file = folder / (name + ".json");
  TESSERA_RETURN_IF_ERROR(write_file(file, run.dump(1)));
  return file;
}

Status write_report(const fs::path& folder) {
  const std::vector<json> runs = read_runs(folder);
  if (runs.empty()) {
    return absl::NotFoundError(absl::StrCat(
        folder.string(), ": no run in this folder; make one with `tessera-bench loopback --report ",
        folder.string(), "`"));
  }
  try {
    return write_file(folder / "index.html", report_page(folder, runs));
  } catch (const json::exception& e) {
    return absl::InvalidArgumentError(
        absl::StrCat(folder.string(), ": a run lacks what the page needs: ", e.what()));
  }
}

}  // namespace tessera::bench
