// R12: more is asked of the device than it can give. Earliest deadline first lowers all frame rates evenly.
#include <algorithm>
#include <memory>
#include <vector>

#include "streaming_fixture.h"

namespace tessera::server {
namespace {

using OverloadTest = test::FakeStreamingTest;

TEST_F(OverloadTest, FrameRatesFallEvenly) {
  start();
  std::vector<SessionTicket> tickets;
  for (int i = 0; i < 4; ++i) tickets.push_back(ticket({.render_time_ns = 20 * kNsPerMs}));
  const std::vector<uint64_t> frames = frames_of(tickets, 20);
  const auto [least, most] = std::ranges::minmax(frames);
  EXPECT_GE(least, 20u);
  EXPECT_LE(static_cast<double>(most), 1.15 * static_cast<double>(least));
}

// Its frames take their time, but between two of them everybody else has a turn.
TEST_F(OverloadTest, ACostlySessionStarvesNobody) {
  start();
  std::vector<SessionTicket> tickets{ticket({.render_time_ns = 60 * kNsPerMs})};
  for (int i = 0; i < 3; ++i) tickets.push_back(ticket());
  const std::vector<uint64_t> frames = frames_of(tickets, 15);
  EXPECT_GE(frames[0], 15u) << "nor is it starved itself";
  for (size_t i = 1; i < frames.size(); ++i)
    EXPECT_GE(1.15 * static_cast<double>(frames[i]), static_cast<double>(frames[0])) << "session " << i;
}

}  // namespace
}  // namespace tessera::server
