#include "bench/progress.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

namespace tessera::bench {
namespace {

using testing::HasSubstr;

TEST(Progress, DurationsReadWell) {
  EXPECT_EQ(format_duration(0), "0 s");
  EXPECT_EQ(format_duration(59.4), "59 s");
  EXPECT_EQ(format_duration(250), "4 min 10 s");
  EXPECT_EQ(format_duration(3900), "1 h 5 min");
  EXPECT_EQ(format_duration(-3), "0 s");
}

TEST(Progress, PlainLinesComeOnceATenth) {
  std::ostringstream out;
  VirtualClock clock;
  Progress progress(out, false, clock);
  progress.estimate(100);
  progress.begin("frames", 1000);
  for (int i = 0; i < 1000; ++i) {
    clock.advance_to((i + 1) * kNsPerSecond / 10);
    progress.advance();
  }
  const std::string text = out.str();
  EXPECT_EQ(text.find("estimated time: 1 min 40 s\n"), 0u);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 11);
  EXPECT_THAT(text, HasSubstr("frames: 50 % (500/1000), 50 s left\n"));
  EXPECT_THAT(text, HasSubstr("frames: 100 % (1000/1000), took 1 min 40 s\n"));
  EXPECT_EQ(text.find('\r'), std::string::npos);
}

TEST(Progress, ATerminalLineIsRewrittenAndEnded) {
  std::ostringstream out;
  VirtualClock clock;
  {
    Progress progress(out, true, clock);
    progress.begin("frames", 10);
    clock.advance_to(kNsPerSecond);
    progress.advance(5);
    progress.advance(1);  // too soon to draw again
    progress.note("a note");
  }
  EXPECT_EQ(out.str(), "\rframes: 50 % (5/10), 1 s left\x1b[K\na note\n");
}

TEST(Progress, SilentMeansSilent) {
  std::ostringstream out;
  Progress progress(out);
  progress.estimate(3);
  progress.begin("frames", 2);
  progress.advance(2);
  progress.note("note");
  EXPECT_EQ(out.str(), "");
}

}  // namespace
}  // namespace tessera::bench
