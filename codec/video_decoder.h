// H.264 → I420, frame by frame, with the frame number from its SEI. Safe for untrusted input.
#pragma once

#include <memory>
#include <optional>
#include <span>

#include "base/frame_number.h"
#include "base/status.h"
#include "base/yuv.h"

namespace tessera::codec {

struct DecodedFrame {
  FrameNumber frame = 0;
  YuvView picture;  // valid until the next decode() or destruction
};

// Not thread-safe.
class VideoDecoder {
 public:
  // Pictures larger than this are refused (ResourceExhausted).
  static StatusOr<std::unique_ptr<VideoDecoder>> create(uint32_t max_width = 8192,
                                                        uint32_t max_height = 8192);
  ~VideoDecoder();

  // One whole access unit in, its picture out (no reordering, no delay). InvalidArgument for damaged data, a
  // missing frame number, or a format other than 8-bit 4:2:0; the decoder then waits for the next key frame.
  StatusOr<DecodedFrame> decode(std::span<const uint8_t> access_unit);

 private:
  struct Impl;
  explicit VideoDecoder(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::codec
