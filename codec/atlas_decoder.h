// Coded atlas → I420, frame by frame. Safe for untrusted input.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "base/atlas_codec.h"
#include "base/frame_number.h"
#include "base/status.h"
#include "base/yuv.h"

namespace tessera::codec {

struct DecodedFrame {
  FrameNumber frame = 0;
  // Valid until the next decode() or destruction. Texels that the encoder was told are unused hold anything.
  YuvView picture;
};

// Not thread-safe.
class AtlasDecoder {
 public:
  // Pictures larger than this are refused (ResourceExhausted).
  static StatusOr<std::unique_ptr<AtlasDecoder>> create(AtlasCodec codec, uint32_t max_width = 8192,
                                                        uint32_t max_height = 8192);
  virtual ~AtlasDecoder() = default;

  // One whole access unit in, its picture out. InvalidArgument: damaged data; video then waits for the next
  // key frame. FailedPrecondition: video that builds on a frame that was not decoded.
  virtual StatusOr<DecodedFrame> decode(std::span<const uint8_t> access_unit) = 0;
};

}  // namespace tessera::codec
