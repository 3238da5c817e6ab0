// H.264 for the atlas: zero latency, CAVLC, one reference, no B-frames; budgets are per frame, so that a
// frame never waits behind another one in the network. Behind one interface: libx264, and NVENC or VAAPI
// where a device has them.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/frame_number.h"
#include "base/status.h"
#include "base/yuv.h"

namespace tessera::codec {

struct VideoSettings {
  uint32_t width = 0, height = 0;  // even
  double frames_per_second = 30;
  double bitrate_bps = 18e6;
  std::string encoder = "auto";     // auto, x264, nvenc, vaapi
  std::string preset = "veryfast";  // of x264
};

// One encoded frame in Annex B, with the frame number in an SEI message (user data unregistered, our UUID):
// UUID, frame number, number of the frame that it is predicted from (its own for key frames), 4 bytes each,
// most significant first.
struct AccessUnit {
  FrameNumber frame = 0;
  bool key_frame = false;
  std::vector<uint8_t> bytes;
};

// Not thread-safe.
class VideoEncoder {
 public:
  // Probes in the order NVENC, VAAPI, x264 for `auto`. What is not there is normal; choice() tells.
  static StatusOr<std::unique_ptr<VideoEncoder>> create(const VideoSettings& settings);
  virtual ~VideoEncoder() = default;

  // `budget_bits`: the size this frame may have (key frames: up to four times the frame budget; the caller
  // passes the number it can afford). The encoder aims below it and may exceed it only by its rounding
  // (tests: 10 %). libx264: a budget that grows from one P-frame to the next is used from the frame after on;
  // what the coarsest quantiser needs (about 0.01 bits a texel of noise, and 1000 bits) cannot be undercut.
  // The first frame is always a key frame.
  virtual StatusOr<AccessUnit> encode(FrameNumber frame, const YuvView& picture, double budget_bits,
                                      bool key_frame) = 0;
  // Which encoder runs and why, e.g. "libx264 (no NVENC: …; no VAAPI: …)".
  virtual const std::string& choice() const = 0;
};

}  // namespace tessera::codec
