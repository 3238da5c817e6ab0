// One frame's way from pose to picture: every timestamp of both ends, and the durations between them (thesis
// 7.1; docs/architecture.md). Filled in by the server, from its own clock and from what the client reports.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>
#include <utility>

#include "base/frame_number.h"
#include "base/time.h"

namespace tessera {

// What the client saw of a frame, on its clock; 0: did not happen.
struct ClientFrameTimes {
  FrameNumber frame = 0;
  TimeNs atlas_first_packet = 0, atlas_complete = 0, atlas_decode_begin = 0, atlas_decoded = 0;
  TimeNs meta_complete = 0, meta_decode_begin = 0, meta_decoded = 0;
  TimeNs draw_begin = 0;  // of its first picture
  TimeNs displayed = 0;   // likewise
  // Server's clock minus the client's, as the client estimated it, and by how much that may be wrong;
  // negative: no estimate yet.
  DurationNs clock_offset = 0, clock_error = -1;

  bool operator==(const ClientFrameTimes&) const = default;
};

// On the server's clock.
struct ServerFrameTimes {
  TimeNs pose_received = 0;
  TimeNs due = 0;  // when the frame should have begun
  TimeNs render_begin = 0, render_end = 0;
  TimeNs sent = 0;  // handed to the network
  // By stopwatch, apart from the two above.
  DurationNs visibility = 0, layout = 0, shading = 0, encode = 0;

  DurationNs stages() const { return visibility + layout + shading + encode; }
  bool operator==(const ServerFrameTimes&) const = default;
};

struct FrameRecord {
  uint64_t session = 0;
  FrameNumber frame = 0;
  bool key_frame = false;
  uint64_t atlas_bytes = 0, meta_bytes = 0;
  TimeNs scene_time = 0;  // that it shows
  // Of the pose that it was made for, on the client's clock: for when it is (it may be a prediction), and
  // when it was sent.
  TimeNs pose_time = 0, pose_sent = 0;
  ServerFrameTimes server;
  ClientFrameTimes client;
};

// The eight durations of thesis 7.1, and what they make.
struct FrameDurations {
  DurationNs pose_uplink = 0;
  DurationNs server_wait = 0;    // the pose, for the next frame to begin
  DurationNs server_render = 0;  // visibility, layout, shading, encode: their stopwatches' sum
  DurationNs downlink = 0;       // of the stream that was decoded last
  // From complete to decoded. The two go on beside each other; the one that ends last counts in sum().
  DurationNs decode_atlas = 0, decode_meta = 0;
  DurationNs client_wait = 0;  // the pair, for the next display frame to begin
  DurationNs display = 0;      // drawing, up to the picture's display

  bool atlas_last = false;    // decoded after the meta
  DurationNs end_to_end = 0;  // pose to picture, by the client's clock alone
  // Of end_to_end, what is neither rendering, encoding, decoding, drawing, the network, nor waiting for the
  // next frame's time: late starts, gaps between stages, and hand-overs between threads.
  DurationNs overhead = 0;

  // Must be end_to_end, but for what the server does between its stages.
  DurationNs sum() const;
  // In order, under the names that are used everywhere.
  std::array<std::pair<std::string_view, DurationNs>, 8> named() const;
};

// Empty unless the frame was displayed and all its times and an estimate of the clocks' offset are there.
std::optional<FrameDurations> durations(const FrameRecord& record);

}  // namespace tessera
