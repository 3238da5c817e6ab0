// Another program, run beside a test and ended with it.
#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

namespace tessera::transport::test {

// Whether a program of this name is on the path.
bool have_program(const std::string& name);

class ChildProcess {
 public:
  // Arguments are parted by blanks; there are no quotes. Its output goes to `log_file`.
  ChildProcess(const std::string& command_line, const std::string& log_file);
  ~ChildProcess();  // kills it if it still runs
  ChildProcess(const ChildProcess&) = delete;

  // Its exit code (128 + signal) once it has ended.
  std::optional<int> exit_code();
  void signal(int number);

 private:
  pid_t pid_ = -1;
  std::optional<int> exit_code_;
};

// A folder that goes away with the test.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  std::string file(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

std::vector<uint8_t> read_file(const std::string& file);
void write_file(const std::string& file, const std::string& text);

}  // namespace tessera::transport::test
