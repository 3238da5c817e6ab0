// Runs a Streamer in virtual time: the client sends its pose with every display frame, the server renders at
// its own rate with the newest pose that has arrived, packets cross the emulated link, and the client draws
// its newest pose. Nothing waits; time jumps from event to event, so a run depends on its settings and its
// seed only.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "base/camera_path.h"
#include "base/frame_record.h"
#include "bench/link.h"
#include "bench/settings.h"
#include "bench/streamer.h"

namespace tessera::bench {

// One display frame that counts: the client has a complete frame.
struct DisplayMoment {
  uint32_t index = 0;  // from 0, at the settings' fps
  TimeNs now_ns = 0;
  TimeNs path_time_ns = 0;
  View view;
  FrameNumber frame = 0;
  bool fresh = false;  // the first display of this frame
};

class StreamSimulation {
 public:
  // `path` stands still at its start until the first complete frame is there; then it runs.
  StreamSimulation(Streamer& streamer, const CameraPath& path, const LoopbackSettings& settings);
  ~StreamSimulation();

  // Runs up to the next display frame that counts. The first call covers the time until the first frame
  // arrives. DeadlineExceeded if no frame arrives within 60 virtual seconds.
  StatusOr<DisplayMoment> next_display();

  // Frames that were shown so far. Both ends have one clock; decoding and drawing take no time, and what a
  // server frame takes is charged to its shading.
  const std::vector<FrameRecord>& shown_frames() const;
  // Pose on the recorded path at a time of the run (before the start: the path's first pose).
  Pose pose_at(TimeNs now_ns) const;
  uint64_t frames_rendered() const;
  uint64_t frames_skipped() const;  // server periods given up because the network was behind
  // Bytes handed to the network per channel since the first display, and that duration.
  double megabits_per_second(Channel channel) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::bench
