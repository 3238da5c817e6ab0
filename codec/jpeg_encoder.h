// The atlas as JPEG tiles: each picture by itself, only the squares that hold samples, by several threads.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "codec/atlas_encoder.h"
#include "codec/jpeg_tile.h"
#include "codec/scale_search.h"

namespace tessera::codec {

class JpegEncoder final : public AtlasEncoder {
 public:
  static StatusOr<std::unique_ptr<JpegEncoder>> create(uint32_t width, uint32_t height);

  StatusOr<AccessUnit> encode(FrameNumber frame, const AtlasPicture& picture, double budget_bits,
                              bool key_frame) override;
  const std::string& choice() const override { return choice_; }

 private:
  struct Coded {
    double scale = 0;
    std::vector<uint8_t> tables;
    std::vector<std::vector<uint8_t>> tiles;
    double bits() const;
  };

  JpegEncoder(uint32_t width, uint32_t height);
  void gather_tiles(const AtlasPicture& picture);
  StatusOr<Coded> compress(double scale);
  StatusOr<Coded> compress_within(double budget_bits);

  const uint32_t width_, height_;
  std::string choice_;
  Occupancy all_;                            // for pictures without gaps
  std::vector<JpegCompressor> compressors_;  // one a worker
  std::vector<uint32_t> mcus_;               // of the current picture, likewise:
  std::vector<YuvImage> tiles_;
  ScaleSearch search_;
};

}  // namespace tessera::codec
