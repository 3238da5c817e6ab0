// Plots of the report, drawn by gnuplot as SVG.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

namespace tessera::bench {

struct Plot {
  std::string title;
  std::string svg;  // empty: gnuplot is missing or failed
};

// SSIM, bitrate, holes and age over time, and the durations, of one run.
std::vector<Plot> plot_run(const nlohmann::json& run);

// Error against compute time and against bitrate, one point for each row of each run.
std::vector<Plot> plot_comparison(std::span<const nlohmann::json> runs);

// Runs gnuplot on a script (without `set terminal`); empty if that fails.
std::string draw_svg(const std::string& script);

}  // namespace tessera::bench
