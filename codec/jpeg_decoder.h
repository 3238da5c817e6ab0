// JPEG tiles → I420, by several threads. Safe for untrusted input.
#pragma once

#include <vector>

#include "codec/atlas_decoder.h"
#include "codec/jpeg_tile.h"
#include "codec/picture_packet.h"

namespace tessera::codec {

class JpegDecoder final : public AtlasDecoder {
 public:
  JpegDecoder(uint32_t max_width, uint32_t max_height);

  StatusOr<DecodedFrame> decode(std::span<const uint8_t> packet) override;

 private:
  struct Worker {
    JpegDecompressor jpeg;
    YuvImage tile;
  };

  Status decode_tile(Worker& worker, const TiledPicture& picture, size_t index);

  const PictureLimits limits_;
  std::vector<Worker> workers_;
  YuvImage picture_;
};

}  // namespace tessera::codec
