// Another program, run beside this one and ended with it.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/status.h"

namespace tessera::bench {

struct ProgramSettings {
  std::filesystem::path file;
  std::vector<std::string> arguments;
  std::vector<std::string> environment;  // NAME=VALUE, beside what it inherits; secrets belong here
  std::filesystem::path log;             // where its output goes
};

// Not thread-safe.
class Program {
 public:
  static StatusOr<std::unique_ptr<Program>> start(const ProgramSettings& settings);
  ~Program();  // kills it if it still runs

  // Once it has ended: its exit code, or 128 + signal.
  std::optional<int> exit_code();
  // Asks it to end (SIGTERM), waits for that, and returns its exit code.
  int end();
  // So far, in MiB.
  double peak_rss_mib() const;
  // What it has written so far.
  std::string output() const;

 private:
  explicit Program(std::filesystem::path log) : log_(std::move(log)) {}
  std::filesystem::path log_;
  pid_t pid_ = -1;
  std::optional<int> exit_code_;
};

// A program that lies beside the running one.
std::filesystem::path sibling_program(const std::string& name);

}  // namespace tessera::bench
