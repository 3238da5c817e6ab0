// The product's programs, started and measured by the harness. Figures belong to `tessera-bench`.
#include "bench/real_loopback.h"

#include <gtest/gtest.h>

#include <set>

#include "../bench/silent_run.h"
#include "base/frame_trace.h"
#include "bench/file_io.h"
#include "bench/loopback.h"
#include "bench/temporary_folder.h"

namespace tessera::bench {
namespace {

StatusOr<LoopbackResult> run(LoopbackSettings s, double server_fps = 10, double seconds = 1.5) {
  s.clock = "real";
  s.seconds = seconds;
  s.fps = 20;
  s.server_fps = server_fps;
  s.size = {160, 90};
  s.atlas = {512, 256};
  s.score_every = 10;
  s.validation = true;
  return run_silently(run_loopback, s);
}

TEST(RealLoopback, EveryFramesDurationsTileItsTime) {
  const auto result = run({.scene = "gallery:0"});
  ASSERT_TRUE(result.ok()) << result.status();
  ASSERT_EQ(result->rows.size(), 1u);
  const Row& row = result->rows[0];
  size_t shown = 0;
  for (const FrameRecord& record : result->records) {
    const auto d = durations(record);
    if (!d) continue;
    ++shown;
    EXPECT_LE(std::abs(d->end_to_end - d->sum()), kNsPerMs) << "frame " << record.frame;
    // Both ends have one clock here: the estimate must say so.
    EXPECT_LE(std::abs(record.client.clock_offset), record.client.clock_error);
  }
  EXPECT_GT(shown, 2u);
  EXPECT_EQ(row.durations_ms.size(), 8u);
  EXPECT_LE(*row.tiling_error_ms_max, 1);
  EXPECT_GT(row.mbps_total, 0);
  EXPECT_GT(row.peak_rss_mib, 1);
  ASSERT_FALSE(result->frames.empty());
  EXPECT_GT(result->frames[0].mssim.at("tessera"), 0.7) << "the path's start, where the client stood still";
  EXPECT_FALSE(result->plan.empty());
}

TEST(RealLoopback, JpegGoesTheWholeWay) {
  const auto result = run({.scene = "gallery:0", .codec = AtlasCodec::jpeg});
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_GT(result->rows[0].frames_displayed, 0u);
  ASSERT_FALSE(result->frames.empty());
  EXPECT_GT(result->frames[0].mssim.at("tessera"), 0.7);
}

// Pictures of a client that stands still in a scene that does, too, depend on nothing but the frame's number,
// as long as the server keeps its rate: a late frame may have more bits (RateSplit::at_interval).
TEST(RealLoopback, PicturesAreThoseOfTheVirtualClock) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "still.csv";
  ASSERT_TRUE(write_file(path, "t_seconds,px,py,pz,qx,qy,qz,qw\n0,0,1.6,6,0,0,0,1\n").ok());
  const auto real = run({.scene = "city:2000", .path = path}, 2, 2.5);
  ASSERT_TRUE(real.ok()) << real.status();
  const std::vector<FrameRecord>& records = real->records;
  const auto late = std::ranges::adjacent_find(records, [](const FrameRecord& a, const FrameRecord& b) {
    return b.server.render_begin - a.server.render_begin > kNsPerSecond;  // two periods
  });
  LoopbackSettings s = real->settings;
  s.clock = "virtual";
  s.split = false;
  s.baselines = {"none"};
  s.truth_cache = "none";
  s.score_every = 1;
  s.seconds = 4;
  const auto virtual_run = run_silently(run_loopback, s);
  ASSERT_TRUE(virtual_run.ok()) << virtual_run.status();
  // The daemon counts frames from 1, virtual time from 0.
  std::map<FrameNumber, double> of_frame;
  for (const DisplayRecord& frame : virtual_run->frames)
    of_frame[frame.frame + 1] = frame.mssim.at("tessera");
  size_t compared = 0;
  for (const DisplayRecord& frame : real->frames) {
    const auto same = of_frame.find(frame.frame);
    if (same == of_frame.end() || (late != records.end() && frame.frame > late->frame)) continue;
    EXPECT_EQ(frame.mssim.at("tessera"), same->second) << "frame " << frame.frame;
    ++compared;
  }
  EXPECT_GT(compared, 0u);
}

TEST(RealLoopback, ManySessionsHaveARowEach) {
  const auto result = run({.scene = "gallery:0", .sessions = 3});
  ASSERT_TRUE(result.ok()) << result.status();
  ASSERT_EQ(result->rows.size(), 3u);
  std::set<uint64_t> sessions;
  for (const FrameRecord& record : result->records) sessions.insert(record.session);
  EXPECT_EQ(sessions.size(), 3u);
  for (const Row& row : result->rows) EXPECT_GT(row.frames_displayed, 0u);
}

TEST(RealLoopback, ADaemonThatCannotStartIsNamedWithItsWords) {
  const auto result = run({.scene = "no_such_file.glb"});
  ASSERT_FALSE(result.ok());
  EXPECT_NE(std::string(result.status().message()).find("no_such_file.glb"), std::string::npos)
      << result.status();
}

}  // namespace
}  // namespace tessera::bench
