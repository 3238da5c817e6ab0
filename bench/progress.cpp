#include "bench/progress.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"

namespace tessera::bench {
namespace {

constexpr DurationNs kRedrawNs = kNsPerSecond / 10;

}  // namespace

std::string format_duration(double seconds) {
  const auto s = static_cast<int64_t>(std::llround(std::max(0.0, seconds)));
  if (s < 60) return absl::StrCat(s, " s");
  if (s < 3600) return absl::StrCat(s / 60, " min ", s % 60, " s");
  return absl::StrCat(s / 3600, " h ", s / 60 % 60, " min");
}

Progress::~Progress() {
  end_line();
}

void Progress::estimate(double seconds) {
  note(absl::StrCat("estimated time: ", format_duration(seconds)));
}

void Progress::begin(std::string_view stage, uint64_t steps) {
  end_line();
  stage_ = stage;
  steps_ = steps;
  done_ = shown_tenth_ = 0;
  begin_ns_ = drawn_ns_ = clock_.now();
}

void Progress::advance(uint64_t steps) {
  done_ = std::min(done_ + steps, steps_);
  if (silent_ || steps_ == 0) return;
  const bool finished = done_ == steps_;
  if (terminal_) {
    if (!finished && clock_.now() - drawn_ns_ < kRedrawNs) return;
    drawn_ns_ = clock_.now();
    out_ << '\r' << line() << "\x1b[K" << std::flush;
    line_open_ = true;
    if (finished) end_line();
  } else if (const uint64_t tenth = 10 * done_ / steps_; tenth > shown_tenth_) {
    shown_tenth_ = tenth;
    out_ << line() << std::endl;
  }
}

void Progress::note(std::string_view line) {
  if (silent_) return;
  end_line();
  out_ << line << std::endl;
}

void Progress::end_line() {
  if (line_open_) out_ << std::endl;
  line_open_ = false;
}

std::string Progress::line() const {
  const double elapsed_s = to_seconds(clock_.now() - begin_ns_);
  const double left_s =
      done_ ? elapsed_s * static_cast<double>(steps_ - done_) / static_cast<double>(done_) : 0;
  const std::string time = done_ == steps_ ? absl::StrCat("took ", format_duration(elapsed_s))
                                           : absl::StrCat(format_duration(left_s), " left");
  return absl::StrCat(stage_, ": ", 100 * done_ / steps_, " % (", done_, "/", steps_, "), ", time);
}

}  // namespace tessera::bench
