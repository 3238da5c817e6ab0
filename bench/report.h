// A folder of runs, and the page that shows them.
//
// Each run leaves `<scene>-<settings>.json` (schema tessera.bench.v1, with the names of its pictures) and its
// pictures as PNG files. index.html is made from all runs in the folder and needs none of them: everything is
// inside.
#pragma once

#include <filesystem>

#include "base/status.h"
#include "bench/result.h"

namespace tessera::bench {

// Adds a run to the folder; a run with the same settings is replaced. Returns the JSON file.
StatusOr<std::filesystem::path> write_run(const std::filesystem::path& folder, const LoopbackResult& result);

// Makes index.html from every run in the folder. Plots need the program `gnuplot`; without it the page says
// so and has its tables and pictures. JSON files of other kinds are skipped with a warning; an error if no
// run is left.
Status write_report(const std::filesystem::path& folder);

}  // namespace tessera::bench
