// tesserad: renders scenes and streams their shading to many clients.
#include <CLI/CLI.hpp>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <future>
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
of the --config file. Flags win over the file, the file over the environment. SIGTERM and SIGINT end the daemon within 5 s:
clients are told.

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

// Waits for a signal beside the daemon, which may be loading a scene just then. Sees to it that the program
// ends in time.
class Terminator {
 public:
  explicit Terminator(const sigset_t& signals) : thread_([this, signals] { run(signals); }) {}
  ~Terminator() {
    ended_.set_value();
    pthread_kill(thread_.native_handle(), SIGTERM);  // where there was none
    thread_.join();
  }
  // The daemon has started: blocks until a signal comes, then the daemon is to end.
  void wait() {
    started_ = true;
    signalled_.get_future().wait();
  }

 private:
  static constexpr std::chrono::milliseconds kShutdownTime{4500};

  void run(const sigset_t& signals) {
    int signal = 0;
    sigwait(&signals, &signal);
    std::future<void> ended = ended_.get_future();
    if (ended.wait_for(std::chrono::seconds(0)) == std::future_status::ready) return;
    spdlog::info("signal {}: shutting down", signal);
    if (!started_) std::_Exit(kOk);  // nobody is there to be told
    signalled_.set_value();
    if (ended.wait_for(kShutdownTime) == std::future_status::ready) return;
    spdlog::warn("shutdown: something still runs after {} ms, e.g. a scene loads; ending without it",
                 kShutdownTime.count());
    std::_Exit(kOk);
  }

  std::atomic<bool> started_ = false;
  std::promise<void> signalled_, ended_;
  std::thread thread_;  // last: uses all of the above
};

int serve(const server::DaemonSettings& settings) {
  Terminator terminator(block_signals());
  const SteadyClock clock;
  auto daemon = server::Daemon::start(settings, clock);
  if (!daemon.ok()) {
    std::cerr << "tesserad: " << daemon.status().message() << std::endl;
    return kFailed;
  }
  spdlog::info("control on {} (gRPC), meta on {} (TCP), media on {} (UDP), at {}", (*daemon)->control_port(),
               (*daemon)->meta_port(), (*daemon)->media_port(), settings.address);
  terminator.wait();
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
