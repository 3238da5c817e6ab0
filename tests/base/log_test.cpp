// ThreadSanitizer does not see into libspdlog; that lines come out whole shows that it locks.
#include "base/log.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
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

TEST(Log, AnEventIsOneLineOfKeysAndValues) {
  init_logging("info");
  const auto log = [] {
    log_event(spdlog::level::info, "client left",
              {{"session", 3}, {"peer", "::1"}, {"name", "a b=\"c\"\n2026 error"}, {"empty", ""}});
  };
  EXPECT_TRUE(
      logged(log).ends_with(R"(info client left session=3 peer=::1 name="a b=\"c\"\n2026 error" empty="")"
                            "\n"));
  init_logging("info", LogFormat::json);
  const std::string line = logged(log);
  const auto json = nlohmann::json::parse(line);
  EXPECT_EQ(json["level"], "info");
  EXPECT_EQ(json["event"], "client left");
  EXPECT_EQ(json["session"], 3);
  EXPECT_EQ(json["name"], "a b=\"c\"\n2026 error");
}

// A peer's text neither breaks a line nor forges one, whatever it is.
TEST(Log, HostileTextStaysInItsField) {
  for (const LogFormat format : {LogFormat::text, LogFormat::json}) {
    init_logging("info", format);
    std::string hostile =
        "\xff\x1e"
        "session\x1f"
        "9";
    for (char c = 1; c < 0x20; ++c) hostile += c;
    const std::string c1 = "\xc2\x9b";  // CSI, which some terminals obey
    const std::string text = logged([&] {
      log_event(spdlog::level::info, "event",
                {{"name", hostile}, {"c1", c1}, {"broken", "\x9b"}, {"load", std::nan("")}});
      spdlog::info("plain\nerror forged");
    });
    EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 2) << text;
    EXPECT_EQ(std::count(text.begin(), text.end(), '\x1b'), 0) << text;
    EXPECT_EQ(std::count(text.begin(), text.end(), '\x9b'), 0) << text;
    if (format == LogFormat::text) continue;
    std::istringstream in(text);
    for (std::string line; std::getline(in, line);) {
      const auto json = nlohmann::json::parse(line, nullptr, false);
      EXPECT_FALSE(json.is_discarded()) << line;
      EXPECT_FALSE(json.contains("session")) << line;
    }
  }
  init_logging("info");
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
