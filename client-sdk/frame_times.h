// When each thing happened to the frames that are under way, until the server is told.
#pragma once

#include <cstddef>
#include <map>
#include <vector>

#include "base/frame_record.h"

namespace tessera::client {

// Bounded: of too many frames the oldest is forgotten. Not thread-safe.
class FrameTimes {
 public:
  static constexpr size_t kMaxFrames = 256;

  // Valid until the next call.
  ClientFrameTimes& of(FrameNumber frame) {
    if (times_.size() == kMaxFrames && !times_.contains(frame)) times_.erase(times_.begin());
    ClientFrameTimes& times = times_[frame];
    times.frame = frame;
    return times;
  }
  // All frames up to `frame`, oldest first; they are forgotten.
  std::vector<ClientFrameTimes> take_up_to(FrameNumber frame) {
    const auto end = times_.upper_bound(frame);
    std::vector<ClientFrameTimes> taken;
    for (auto at = times_.begin(); at != end; ++at) taken.push_back(at->second);
    times_.erase(times_.begin(), end);
    return taken;
  }

 private:
  std::map<FrameNumber, ClientFrameTimes> times_;
};

}  // namespace tessera::client
