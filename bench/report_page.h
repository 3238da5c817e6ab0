// The report's HTML.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>

namespace tessera::bench {

// One self-contained page. `folder`: where the runs' picture files lie. Throws nlohmann::json::exception on a
// run that lacks what the schema demands.
std::string report_page(const std::filesystem::path& folder, std::span<const nlohmann::json> runs);

}  // namespace tessera::bench
