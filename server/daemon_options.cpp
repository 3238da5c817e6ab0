#include "server/daemon_options.h"

#include <CLI/CLI.hpp>
#include <cctype>

namespace tessera::server {

void add_options(CLI::App& app, DaemonSettings& s, LogSettings& log) {
  const auto variable = [](const std::string& name) {
    std::string out = "TESSERAD_" + name;
    for (char& c : out) c = c == '-' ? '_' : static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    return out;
  };
  const auto add = [&](const char* group, const std::string& name, auto& field, const char* meaning) {
    return app.add_option("--" + name, field, meaning)
        ->group(group)
        ->envname(variable(name))
        ->capture_default_str();
  };
  const auto flag = [&](const char* group, const std::string& name, bool& field, const char* meaning) {
    app.add_flag("--" + name, field, meaning)->group(group)->envname(variable(name));
  };
  add("Network", "address", s.address,
      "where to listen, in numbers; beyond loopback TLS and a control token are needed, or --insecure");
  add("Network", "control-port", s.control_port, "gRPC; 0 takes a free one");
  add("Network", "meta-port", s.meta_port, "TCP: geometry and control of a stream");
  add("Network", "media-port", s.media_port, "UDP: video and poses");
  add("Network", "http-port", s.http_port, "HTTP (HTTPS with a certificate): /metrics, /healthz, /readyz");
  flag("Network", "no-http", s.no_http, "open no HTTP port");
  add("Network", "tls-certificate", s.tls_certificate, "PEM file; media is then SRTP");
  add("Network", "tls-key", s.tls_key, "PEM file");
  add("Network", "control-token-file", s.control_token_file,
      "its first line is a secret that gRPC calls must show; others may not read it (chmod o=)");
  flag("Network", "insecure", s.insecure,
       "beyond loopback, do without TLS (tokens and pictures go in clear text) and without a control token");
  add("Sessions", "max-sessions", s.max_sessions, "more are refused")->check(CLI::Range(1, 1024));
  add("Sessions", "max-atlas-mtexels", s.max_atlas_mtexels,
      "2^20 texels of all sessions' atlases together; an atlas of 2048x1024 has 2")
      ->check(CLI::Range(1, 65536));
  add("Sessions", "idle-timeout", s.idle_timeout,
      "seconds that a session is kept without a client; 0: for ever")
      ->check(CLI::Range(0, 1'000'000));
  add("Sessions", "max-watchers", s.max_watchers,
      "WatchSession, WatchFrames and ForwardStream calls at a time")
      ->check(CLI::Range(1, 1024));
  // An empty text stands for none, as CLI11 writes it.
  app.add_option_function<std::vector<std::string>>(
         "--scene",
         [&s](const std::vector<std::string>& scenes) {
           s.scenes = scenes;
           std::erase(s.scenes, "");
         },
         "NAME=SOURCE to load at the start; a glTF file, gallery[:detail], city[:triangles], pipe")
      ->group("Scenes")
      ->run_callback_for_default()  // so that it is printed like the others
      ->envname("TESSERAD_SCENE");
  add("Scenes", "scene-root", s.scene_root, "folder below which LoadScene may read; none: it reads no files");
  add("Scenes", "max-scene-mib", s.max_scene_mib, "device memory of all scenes together; 0: no limit")
      ->check(CLI::Range(0, 1 << 20));
  add("Rendering", "device", s.device, "Vulkan device: cpu, an index, or part of its name");
  std::vector<std::string> paths;
  for (const std::string_view path : shading::kGatherPathNames) paths.emplace_back(path);
  add("Rendering", "gather", s.gather,
      "passes that shade the atlas; auto: the cheapest by shape and size, measured while a scene loads (a "
      "software device: by a table)")
      ->check(CLI::IsMember(paths));
  add("Logs", "log", log.level, "level on standard error")
      ->check(CLI::IsMember({"trace", "debug", "info", "warn", "error", "off"}));
  add("Logs", "log-format", log.format, "text (event key=value …) or json, a line an event")
      ->check(CLI::IsMember({"text", "json"}));
}

}  // namespace tessera::server
