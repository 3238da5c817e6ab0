// One streaming method with both of its ends, driven by StreamSimulation in virtual time. Ours and the
// baselines are streamers, so that all of them meet the same poses, the same network and the same scoring.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/frame_number.h"
#include "base/image.h"
#include "base/status.h"
#include "base/view.h"
#include "bench/link.h"
#include "bench/settings.h"

namespace tessera::bench {

struct Packet {
  Channel channel;
  std::vector<uint8_t> bytes;
};

// The client's resolution and field of view, without a pose.
inline View client_view(const LoopbackSettings& s) {
  View view;
  view.width = s.size.width;
  view.height = s.size.height;
  view.fov = Fov::symmetric(static_cast<float>(glm::radians(s.fov_y_deg)),
                            static_cast<float>(s.size.width) / static_cast<float>(s.size.height));
  return view;
}

struct ServeRequest {
  FrameNumber number = 0;
  std::span<const TimedPose> poses;  // received so far, newest last
  DurationNs round_trip_ns = 0;      // as the client last measured it: pose sent → picture made of it shown
  TimeNs scene_time_ns = 0;
  bool key_frame = false;
};

class Streamer {
 public:
  virtual ~Streamer() = default;
  virtual std::string name() const = 0;

  // Server: renders and encodes one frame. Meta packets come before atlas packets.
  virtual StatusOr<std::vector<Packet>> serve(const ServeRequest& request) = 0;
  // Client: one packet arrived whole.
  virtual Status deliver(Channel channel, std::span<const uint8_t> bytes) = 0;
  // Client, once a display frame: takes the newest complete frame. Its number, or nullopt before the first
  // one.
  virtual std::optional<FrameNumber> newest_frame() = 0;
  // Client: the picture for `view`, made of that frame.
  virtual StatusOr<Image8> draw(const View& view) = 0;
  virtual bool wants_key_frame() const = 0;
};

}  // namespace tessera::bench
