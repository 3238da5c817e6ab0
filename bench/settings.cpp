#include "bench/settings.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>
#include <map>
#include <nlohmann/json.hpp>
#include <ostream>
#include <sstream>

namespace tessera::bench {
namespace {

// The one list of options: group, name, field, meaning. Everything else is derived from it.
template <class Settings, class Visitor>
void for_each_option(Settings& s, Visitor&& visit) {
  visit("Input", "scene", s.scene, "glTF file, or gallery[:detail], or city[:triangles], or pipe");
  visit("Input", "path", s.path, "camera path (CSV), or gallery, or city, or pipe");
  visit("Input", "start", s.start_s, "where on the path to begin, in seconds");
  visit("Input", "seconds", s.seconds, "how long to run");
  visit("Client", "fps", s.fps, "display rate");
  visit("Client", "size", s.size, "display size in pixels");
  visit("Client", "fov-y", s.fov_y_deg, "vertical field of view in degrees");
  visit("Server", "server-fps", s.server_fps, "server frame rate");
  visit("Server", "server-ms", s.server_ms, "time charged to a server frame in virtual time");
  visit("Server", "atlas", s.atlas, "atlas size in texels (even; width a multiple of 8)");
  visit("Server", "layout", s.layout, "atlas layout");
  visit("Server", "codec", s.codec, "atlas coding; raw does without, whatever the bit rate");
  visit("Server", "bitrate-mbps", s.bitrate_mbps, "atlas and meta together");
  visit("Server", "pvs", s.pvs, "prediction of the potentially visible set");
  visit("Server", "gather", s.gather,
        "passes that shade the atlas; auto: the cheapest by shape and size, measured while a scene loads (a "
        "software device: by a table)");
  visit("Server", "device", s.device, "Vulkan device: cpu, an index, or part of its name");
  visit("Server", "validation", s.validation, "load the Vulkan validation layer, which logs misuse");
  visit("Network", "delay-ms", s.delay_ms, "one way");
  visit("Network", "jitter-ms", s.jitter_ms, "uniform, plus or minus");
  visit("Network", "loss", s.loss, "share of datagrams lost (they are sent again)");
  visit("Network", "clock", s.clock,
        "virtual: one process, no waiting, repeatable; real: daemon and clients as processes over loopback, "
        "where "
        "--server-ms, the emulated network, --pvs, --split, --baselines and --truth-cache do not apply");
  visit("Network", "sessions", s.sessions, "clients at a time, with the real clock");
  visit("Network", "seed", s.seed, "of jitter and loss");
  visit("Scoring", "score-every", s.score_every, "score every n-th displayed frame");
  visit("Scoring", "truth", s.truth, "4x supersampled, or 1x");
  visit("Scoring", "split", s.split, "split the error by cause");
  visit("Scoring", "baselines", s.baselines, "plain-video, mesh-warp, or none");
  visit("Scoring", "truth-cache", s.truth_cache,
        "folder of rendered truth; none = do not keep; default: user cache");
  visit("Output", "json", s.json, "write the result to this file");
  visit("Output", "report", s.report, "add this run to the report in this folder");
  visit("Output", "frames-csv", s.frames_csv, "write a line for every server frame to this file");
  visit("Output", "trace", s.trace,
        "write the frames as a trace for Perfetto or chrome://tracing to this file");
  visit("Output", "estimate-only", s.estimate_only, "print how long the run would take, and stop");
}

const std::map<std::string, atlas::LayoutKind> kLayouts{{"blocks", atlas::LayoutKind::blocks},
                                                        {"coherent", atlas::LayoutKind::coherent},
                                                        {"tessellated", atlas::LayoutKind::tessellated}};
const std::map<std::string, AtlasCodec> kCodecs = [] {
  std::map<std::string, AtlasCodec> codecs;
  for (const auto& [codec, name] : kAtlasCodecs) codecs.emplace(name, codec);
  return codecs;
}();
const std::map<std::string, Truth> kTruths{{"4x", Truth::supersampled}, {"1x", Truth::one}};
const std::map<std::string, Prediction> kPredictions{{"linear", Prediction::linear},
                                                     {"none", Prediction::none}};
const std::map<std::string, shading::GatherPath> kGathers = [] {
  std::map<std::string, shading::GatherPath> paths;
  for (const std::string_view name : shading::kGatherPathNames)
    paths.emplace(name, *shading::gather_path_named(name));
  return paths;
}();

template <class E>
std::string name_of(const std::map<std::string, E>& names, E value) {
  return std::find_if(names.begin(), names.end(), [&](const auto& n) { return n.second == value; })->first;
}

std::string environment_name(std::string name) {
  for (char& c : name) c = c == '-' ? '_' : static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return "TESSERA_BENCH_" + name;
}

struct AddOption {
  CLI::App& app;

  template <class T>
  void operator()(const char* group, const std::string& name, T& field, const char* meaning) const {
    finish(app.add_option("--" + name, field, meaning), group, name);
  }
  void operator()(const char* group, const std::string& name, std::vector<std::string>& field,
                  const char* meaning) const {
    finish(app.add_option("--" + name, field, meaning)->delimiter(','), group, name);
  }
  // A switch that is off by default is a plain flag (--x or --x=on); one that is on takes its value (--x
  // off).
  void operator()(const char* group, const std::string& name, bool& field, const char* meaning) const {
    CLI::Option* option =
        field ? app.add_option("--" + name, field, meaning) : app.add_flag("--" + name, field, meaning);
    finish(option, group, name);
  }
  void operator()(const char* group, const std::string& name, atlas::LayoutKind& field,
                  const char* meaning) const {
    add_choice(group, name, field, meaning, kLayouts);
  }
  void operator()(const char* group, const std::string& name, AtlasCodec& field, const char* meaning) const {
    add_choice(group, name, field, meaning, kCodecs);
  }
  void operator()(const char* group, const std::string& name, Truth& field, const char* meaning) const {
    add_choice(group, name, field, meaning, kTruths);
  }
  void operator()(const char* group, const std::string& name, Prediction& field, const char* meaning) const {
    add_choice(group, name, field, meaning, kPredictions);
  }
  void operator()(const char* group, const std::string& name, shading::GatherPath& field,
                  const char* meaning) const {
    add_choice(group, name, field, meaning, kGathers);
  }

  template <class E>
  void add_choice(const char* group, const std::string& name, E& field, const char* meaning,
                  const std::map<std::string, E>& names) const {
    CLI::Option* option = app.add_option_function<std::string>(
        "--" + name, [&field, &names](const std::string& value) { field = names.at(value); }, meaning);
    std::vector<std::string> choices;
    for (const auto& [choice, value] : names) choices.push_back(choice);
    finish(option->check(CLI::IsMember(choices))->default_str(name_of(names, field)), group, name);
  }
  static void finish(CLI::Option* option, const char* group, const std::string& name) {
    option->group(group)->envname(environment_name(name));
    if (option->get_default_str().empty()) option->capture_default_str();
  }
};

struct WriteJson {
  nlohmann::json& out;

  template <class T>
  void operator()(const char*, const char* name, const T& field, const char*) const {
    out[name] = field;
  }
  void operator()(const char*, const char* name, const Size& field, const char*) const {
    out[name] = absl::StrCat(field.width, "x", field.height);
  }
  void operator()(const char*, const char* name, atlas::LayoutKind field, const char*) const {
    out[name] = name_of(kLayouts, field);
  }
  void operator()(const char*, const char* name, AtlasCodec field, const char*) const {
    out[name] = name_of(kCodecs, field);
  }
  void operator()(const char*, const char* name, Truth field, const char*) const {
    out[name] = name_of(kTruths, field);
  }
  void operator()(const char*, const char* name, Prediction field, const char*) const {
    out[name] = name_of(kPredictions, field);
  }
  void operator()(const char*, const char* name, shading::GatherPath field, const char*) const {
    out[name] = name_of(kGathers, field);
  }
};

std::string flag_value(const nlohmann::json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (!value.is_array()) return value.dump();
  std::string joined;
  for (const auto& item : value) joined += (joined.empty() ? "" : ",") + item.get<std::string>();
  return joined;
}

CLI::Validator sizes(uint32_t max, uint32_t width_multiple, uint32_t height_multiple) {
  return CLI::Validator(
      [=](std::string& text) {
        std::istringstream in(text);
        Size s;
        if (!(in >> s) || s.width == 0 || s.height == 0 || s.width > max || s.height > max) {
          return absl::StrCat("is not a size like 960x540 with sides up to ", max, ": ", text);
        }
        if (s.width % width_multiple || s.height % height_multiple) {
          return absl::StrCat("needs a width that is a multiple of ", width_multiple, " and a height of ",
                              height_multiple, ": ", text);
        }
        return std::string();
      },
      "WxH");
}

void add_checks(CLI::App& app) {
  const auto check = [&app](const char* name, const CLI::Validator& validator) {
    if (CLI::Option* option = app.get_option_no_throw(name)) option->check(validator);
  };
  check("--start", CLI::Range(0.0, 1e6));
  check("--seconds", CLI::Range(0.01, 36000.0));
  check("--fps", CLI::Range(1.0, 1000.0));
  check("--server-fps", CLI::Range(0.5, 1000.0));
  check("--server-ms", CLI::Range(0.0, 10000.0));
  check("--size", sizes(8192, 2, 2));
  check("--atlas", sizes(8192, 8, 2));
  check("--fov-y", CLI::Range(1.0, 179.0));
  check("--bitrate-mbps", CLI::Range(0.01, 10000.0));
  check("--delay-ms", CLI::Range(0.0, 10000.0));
  check("--jitter-ms", CLI::Range(0.0, 10000.0));
  check("--loss", CLI::Range(0.0, 0.5));
  check("--clock", CLI::IsMember({"virtual", "real"}));
  check("--sessions", CLI::Range(1, 1000));
  check("--seed", CLI::NonNegativeNumber);
  check("--score-every", CLI::Range(1, 1'000'000));
  check("--baselines", CLI::IsMember({"plain-video", "mesh-warp", "none"}));
}

}  // namespace

std::istream& operator>>(std::istream& in, Size& size) {
  char x = 0;
  std::string rest;
  Size read;
  if (!std::isdigit(in.peek()) || !(in >> read.width >> x) || x != 'x' || !std::isdigit(in.peek()) ||
      !(in >> read.height)) {
    in.setstate(std::ios::failbit);
  } else if (in.peek() != std::istream::traits_type::eof()) {
    in.setstate(std::ios::failbit);
  } else {
    size = read;
    in.clear();
  }
  return in;
}

std::ostream& operator<<(std::ostream& out, const Size& size) {
  return out << size.width << 'x' << size.height;
}

bool LoopbackSettings::wants_baseline(std::string_view name) const {
  return std::find(baselines.begin(), baselines.end(), "none") == baselines.end() &&
         std::find(baselines.begin(), baselines.end(), name) != baselines.end();
}

void add_options(CLI::App& app, LoopbackSettings& settings, std::span<const std::string> names) {
  const AddOption add{app};
  for_each_option(settings, [&](const char* group, const char* name, auto& field, const char* meaning) {
    if (names.empty() || std::ranges::find(names, name) != names.end()) add(group, name, field, meaning);
  });
  add_checks(app);
}

nlohmann::json to_json(const LoopbackSettings& settings) {
  nlohmann::json json;
  for_each_option(settings, WriteJson{json});
  return json;
}

std::vector<std::string> to_flags(const LoopbackSettings& settings, const LoopbackSettings& defaults) {
  const nlohmann::json values = to_json(settings), others = to_json(defaults);
  std::vector<std::string> flags;
  for (const auto& [name, value] : values.items()) {
    if (value != others[name]) flags.push_back("--" + name + "=" + flag_value(value));
  }
  return flags;
}

}  // namespace tessera::bench
