// What a person sees while a long run works: the estimated time first, then how far it is.
#pragma once

#include <cstdint>
#include <ostream>
#include <string>
#include <string_view>

#include "base/time.h"

namespace tessera::bench {

// On a terminal one line that rewrites itself; elsewhere plain lines, at most one for each ten percent. Not
// thread-safe.
class Progress {
 public:
  // `out` and `clock` must outlive it.
  Progress(std::ostream& out, bool terminal, const Clock& clock)
      : out_(out), terminal_(terminal), clock_(clock) {}
  // A silent one.
  explicit Progress(std::ostream& out) : out_(out), silent_(true), clock_(steady_) {}
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  // Once, before the work: "estimated time: 4 min 10 s".
  void estimate(double seconds);
  // A stage of `steps` steps begins, e.g. "frames"; an unfinished stage before it ends.
  void begin(std::string_view stage, uint64_t steps);
  void advance(uint64_t steps = 1);
  // A line of its own.
  void note(std::string_view line);

 private:
  void end_line();
  std::string line() const;

  std::ostream& out_;
  bool terminal_ = false, silent_ = false;
  SteadyClock steady_;
  const Clock& clock_;
  std::string stage_;
  uint64_t steps_ = 0, done_ = 0;
  uint64_t shown_tenth_ = 0;  // plain lines
  TimeNs begin_ns_ = 0, drawn_ns_ = 0;
  bool line_open_ = false;
};

// "42 s", "4 min 10 s", "1 h 5 min".
std::string format_duration(double seconds);

}  // namespace tessera::bench
