// H.264 → I420, frame by frame, with the frame number from its SEI. Safe for untrusted input.
#pragma once

#include <memory>

#include "codec/atlas_decoder.h"

namespace tessera::codec {

// Not thread-safe.
class VideoDecoder final : public AtlasDecoder {
 public:
  // Pictures larger than this are refused (ResourceExhausted).
  static StatusOr<std::unique_ptr<VideoDecoder>> create(uint32_t max_width = 8192,
                                                        uint32_t max_height = 8192);
  ~VideoDecoder() override;

  // One whole access unit in, its picture out (no reordering, no delay). InvalidArgument for damaged data, a
  // missing frame number, or a format other than 8-bit 4:2:0; the decoder then waits for the next key frame.
  StatusOr<DecodedFrame> decode(std::span<const uint8_t> access_unit) override;

 private:
  struct Impl;
  explicit VideoDecoder(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::codec
