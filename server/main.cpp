// tesserad: renders scenes and streams their shading to many clients.
#include <CLI/CLI.hpp>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <iostream>
#include <nlohmann/json.hpp>
#include <thread>

#include "base/log.h"
#include "server/daemon.h"
#include "server/daemon_options.h"
#include "server/doctor.h"

namespace {

using namespace tessera;

enum ExitCode { kOk = 0, kFailed = 1, kUsage = 2 };

constexpr char kFooter[] =
    R"(Configuration: every option is also an environment variable (--max-sessions = TESSERAD_MAX_SESSIONS) and a key
of the --config file. Flags win over the file, the file over the environment. SIGTERM and SIGINT end the daemon: clients are
told.

Examples:
  tesserad --scene hall=gallery
  tesserad --scene sponza=sponza.glb --scene-root /srv/scenes --max-sessions 8
  tesserad --address 0.0.0.0 --tls-certificate server.pem --tls-key server.key --control-token-file token --scene hall=gallery
  tesserad --config tesserad.toml --check-config
  tesserad --config tesserad.toml doctor         # would it start? if not, what to do
  tesserad --print-config > tesserad.toml        # every option with its default
  curl http://127.0.0.1:7313/readyz              # and /metrics, /healthz

Exit codes: 0 ended by a signal, or what was asked for is done; 1 could not start, or doctor found a fault; 2 wrong usage
or configuration.)";

constexpr std::chrono::milliseconds kShutdownTime{4500};

// Signals are taken by whoever waits for them, in no other thread.
sigset_t block_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
  return signals;
}

int serve(const server::DaemonSettings& settings) {
  const sigset_t signals = block_signals();
  const SteadyClock clock;
  std::atomic<bool> serving = false;
  std::jthread waits_for_signal([&] {
    int signal = 0;
    sigwait(&signals, &signal);
    log_event(spdlog::level::info, "shutting down", {{"signal", signal}});
    if (!serving) std::_Exit(kOk);  // scenes are loading, and nobody is connected
  });
  auto daemon = server::Daemon::start(settings, clock);
  if (!daemon.ok()) {
    std::cerr << "tesserad: " << daemon.status().message() << std::endl;
    // Past the thread that waits.
    std::_Exit(absl::IsInvalidArgument(daemon.status()) ? kUsage : kFailed);
  }
  log_event(spdlog::level::info, "serving",
            {{"address", settings.address},
             {"control_port", (*daemon)->control_port()},
             {"meta_port", (*daemon)->meta_port()},
             {"media_port", (*daemon)->media_port()},
             {"http_port", (*daemon)->http_port()}});
  serving = true;
  waits_for_signal.join();
  std::thread([] {
    std::this_thread::sleep_for(kShutdownTime);
    log_event(spdlog::level::warn, "shutdown cut short",
              {{"seconds", std::chrono::duration<double>(kShutdownTime).count()}});
    std::_Exit(kOk);
  }).detach();  // nothing stops a call that is loading a scene
  daemon->reset();
  return kOk;
}

int print_findings(const server::DaemonSettings& settings, bool json) {
  bool well = true;
  auto list = nlohmann::json::array();
  for (const server::Finding& finding : server::examine(settings)) {
    const std::string text = finding.status.ok() ? finding.detail : std::string(finding.status.message());
    well = well && finding.status.ok();
    list.push_back({{"check", finding.check}, {"ok", finding.status.ok()}, {"detail", text}});
    if (!json)
      std::cout << (finding.status.ok() ? "ok      " : "failed  ") << finding.check << ": " << text << "\n";
  }
  if (json) std::cout << nlohmann::json{{"ok", well}, {"checks", list}}.dump(1) << "\n";
  return well ? kOk : kFailed;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Renders 3D scenes and streams their shading to thin clients.", "tesserad");
  app.footer(kFooter);
  app.set_config("--config", "", "read options from this TOML or INI file");
  server::DaemonSettings settings;
  server::LogSettings log;
  bool json = false, check_config = false, print_config = false;
  server::add_options(app, settings, log);
  app.set_version_flag("--version", std::string("tesserad ") + server::version());
  app.get_option("--version")->configurable(false);
  CLI::App* doctor =
      app.add_subcommand("doctor", "check whether the daemon would start with these options, and stop");
  doctor->fallthrough()->configurable(false);
  doctor->add_flag("--json", json, "for machines")->configurable(false);
  app.add_flag("--check-config", check_config, "read all options, say whether they are right, and stop")
      ->configurable(false);
  app.add_flag("--print-config", print_config, "print the options in force as a config file, and stop")
      ->configurable(false);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kOk : kUsage;
  }
  init_logging(log.level, log.format == "json" ? LogFormat::json : LogFormat::text);
  if (print_config) {
    std::cout << app.config_to_str(true, true);
    return kOk;
  }
  if (check_config) {
    const Status status = server::check(settings);
    if (status.ok()) std::cout << "the configuration is right\n";
    if (!status.ok()) std::cerr << "tesserad: " << status.message() << std::endl;
    return status.ok() ? kOk : kUsage;
  }
  if (*doctor) return print_findings(settings, json);
  return serve(settings);
}
