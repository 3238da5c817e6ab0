#include "server/daemon_options.h"

#include <CLI/CLI.hpp>
#include <cctype>

namespace tessera::server {

void add_options(CLI::App& app, DaemonSettings& s, std::string& log_level) {
  const auto add = [&app](const char* group, const std::string& name, auto& field, const char* meaning) {
    std::string variable = "TESSERAD_" + name;
    for (char& c : variable)
      c = c == '-' ? '_' : static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    return app.add_option("--" + name, field, meaning)
        ->group(group)
        ->envname(variable)
        ->capture_default_str();
  };
  add("Network", "address", s.address,
      "where to listen, in numbers; beyond loopback TLS or --insecure is needed");
  add("Network", "control-port", s.control_port, "gRPC; 0 takes a free one");
  add("Network", "meta-port", s.meta_port, "TCP: geometry and control of a stream");
  add("Network", "media-port", s.media_port, "UDP: video and poses");
  add("Network", "tls-certificate", s.tls_certificate, "PEM file; media is then SRTP");
  add("Network", "tls-key", s.tls_key, "PEM file");
  app.add_flag("--insecure", s.insecure, "send tokens and pictures in clear text beyond loopback")
      ->group("Network")
      ->envname("TESSERAD_INSECURE");
  add("Sessions", "max-sessions", s.max_sessions, "more are refused")->check(CLI::Range(1, 1024));
  // An empty text stands for none, as CLI11 writes it.
  app.add_option_function<std::vector<std::string>>(
         "--scene",
         [&s](const std::vector<std::string>& scenes) {
           s.scenes = scenes;
           std::erase(s.scenes, "");
         },
         "NAME=SOURCE to load at the start; a glTF file, gallery[:detail], city[:triangles]")
      ->group("Scenes")
      ->envname("TESSERAD_SCENE");
  add("Scenes", "scene-root", s.scene_root, "folder below which LoadScene may read; none: it reads no files");
  add("Rendering", "device", s.device, "Vulkan device: cpu, an index, or part of its name");
  add("Logs", "log", log_level, "level on standard error")
      ->check(CLI::IsMember({"trace", "debug", "info", "warn", "error", "off"}));
}

}  // namespace tessera::server
