// ThreadSanitizer does not see into libspdlog; that lines come out whole shows that it locks.
#include "base/log.h"

#include <gtest/gtest.h>

#include <map>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

namespace tessera {
namespace {

// What `body` logs.
template <class Body>
std::string logged(Body&& body) {
  testing::internal::CaptureStderr();
  body();
  return testing::internal::GetCapturedStderr();
}

TEST(Log, AnUnknownLevelMeansInfo) {
  init_logging("loud");
  const std::string text = logged([] {
    spdlog::debug("hidden");
    spdlog::info("shown");
  });
  EXPECT_EQ(text.find("hidden"), std::string::npos);
  EXPECT_NE(text.find("info shown"), std::string::npos);
}

TEST(Log, OffMeansOff) {
  init_logging("off");
  EXPECT_EQ(logged([] { spdlog::critical("shown"); }), "");
}

TEST(Log, LinesOfSeveralThreadsAreWholeAndInEachThreadsOrder) {
  constexpr int kThreads = 4, kLines = 250;
  init_logging("info");
  const std::string text = logged([] {
    std::vector<std::jthread> threads;
    for (int t = 0; t < kThreads; ++t) {
      threads.emplace_back([t] {
        for (int line = 0; line < kLines; ++line) spdlog::info("thread {} line {} end", t, line);
      });
    }
  });
  std::map<int, int> lines_of;
  std::istringstream in(text);
  for (std::string stamp, level, word, end; in >> stamp >> level >> word;) {
    int thread = -1, line = -1;
    ASSERT_TRUE(in >> thread >> word >> line >> end);
    ASSERT_EQ(end, "end");
    ASSERT_EQ(line, lines_of[thread]++);
  }
  ASSERT_EQ(lines_of.size(), size_t{kThreads});
  for (const auto& [thread, lines] : lines_of) EXPECT_EQ(lines, kLines) << thread;
}

}  // namespace
}  // namespace tessera
