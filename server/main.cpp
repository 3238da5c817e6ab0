// tesserad: renders scenes and streams their shading to many clients.
#include <CLI/CLI.hpp>
#include <csignal>
#include <iostream>
#include <thread>

#include "base/log.h"
#include "server/daemon.h"
#include "server/daemon_options.h"

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
  tesserad --address 0.0.0.0 --tls-certificate server.pem --tls-key server.key --scene hall=gallery
  tesserad --config tesserad.toml --check-config

Exit codes: 0 ended by a signal, 1 could not start, 2 wrong usage.)";

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
  auto daemon = server::Daemon::start(settings, clock);
  if (!daemon.ok()) {
    std::cerr << "tesserad: " << daemon.status().message() << std::endl;
    return kFailed;
  }
  spdlog::info("control on {} (gRPC), meta on {} (TCP), media on {} (UDP), at {}", (*daemon)->control_port(),
               (*daemon)->meta_port(), (*daemon)->media_port(), settings.address);
  int signal = 0;
  sigwait(&signals, &signal);
  spdlog::info("signal {}: shutting down", signal);
  daemon->reset();
  return kOk;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Renders 3D scenes and streams their shading to thin clients.", "tesserad");
  app.footer(kFooter);
  app.set_config("--config", "", "read options from this TOML or INI file");
  server::DaemonSettings settings;
  std::string log_level = "info";
  bool check_config = false, print_config = false;
  server::add_options(app, settings, log_level);
  app.add_flag("--check-config", check_config, "read all options, say whether they are right, and stop")
      ->configurable(false);
  app.add_flag("--print-config", print_config, "print the options in force as a config file, and stop")
      ->configurable(false);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kOk : kUsage;
  }
  init_logging(log_level);
  if (print_config) {
    std::cout << app.config_to_str(true, true);
    return kOk;
  }
  if (check_config) {
    std::cout << "the configuration is right\n";
    return kOk;
  }
  return serve(settings);
}
