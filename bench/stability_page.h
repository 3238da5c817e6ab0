// The stability catalogue on the report's page.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace tessera::bench {

// Whether the run is one of `stability`.
bool is_stability_run(const nlohmann::json& run);
// A table of its cases.
std::string stability_html(const nlohmann::json& run);

}  // namespace tessera::bench
