// The options that `loopback` and the experiments share.
#pragma once

#include <cstdint>
#include <iosfwd>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "atlas/layout.h"
#include "base/atlas_codec.h"
#include "base/status.h"
#include "gpu/device.h"
#include "shading/gather_choice.h"

namespace CLI {
class App;
}

namespace tessera::bench {

// Written as 960x540.
struct Size {
  uint32_t width = 0, height = 0;
  bool operator==(const Size&) const = default;
};
std::istream& operator>>(std::istream& in, Size& size);
std::ostream& operator<<(std::ostream& out, const Size& size);

enum class Truth { supersampled, one };  // 4x or 1x
enum class Prediction { linear, none };

struct LoopbackSettings {
  // Input
  std::string scene = "gallery";
  std::string path = "gallery";
  double start_s = 0;  // on the path
  double seconds = 10;
  // Client
  double fps = 60;
  Size size{960, 540};
  double fov_y_deg = 60;
  // Server
  double server_fps = 30;
  double server_ms = 33.3;  // charged to a server frame in virtual time
  Size atlas{2048, 1024};
  atlas::LayoutKind layout = atlas::kDefaultLayout;
  AtlasCodec codec = AtlasCodec::h264;
  double bitrate_mbps = 20;  // atlas and meta together
  Prediction pvs = Prediction::linear;
  shading::GatherPath gather = shading::GatherPath::automatic;
  std::string device = "cpu";
  bool validation = gpu::DeviceOptions{}.validation;
  // Network
  double delay_ms = 50;  // one way
  double jitter_ms = 0;  // uniform ±
  double loss = 0;       // share of datagrams
  std::string clock = "virtual";
  uint32_t sessions = 1;  // with the real clock
  uint64_t seed = 1;
  // Scoring
  uint32_t score_every = 1;  // displayed frames
  Truth truth = Truth::supersampled;
  bool split = true;
  std::vector<std::string> baselines{"plain-video", "mesh-warp"};  // or only `none`
  std::string truth_cache;  // folder; empty = the user's cache folder, `none` = keep nothing
  // Output
  std::string json;               // file
  std::string report;             // folder
  std::string frames_csv, trace;  // files of all frame records
  bool estimate_only = false;

  bool operator==(const LoopbackSettings&) const = default;
  bool wants_baseline(std::string_view name) const;
};

// Adds the options `names` (all if empty) to `app`: flags, environment variables TESSERA_BENCH_<OPTION>,
// checks, groups. `settings` must outlive the parse, and gives the defaults.
void add_options(CLI::App& app, LoopbackSettings& settings, std::span<const std::string> names = {});

// Option name → value, as JSON; what add_options() would read to get the same settings.
nlohmann::json to_json(const LoopbackSettings& settings);

// The flags that differ from the defaults, e.g. {"--fps=30"}.
std::vector<std::string> to_flags(const LoopbackSettings& settings, const LoopbackSettings& defaults = {});

}  // namespace tessera::bench
