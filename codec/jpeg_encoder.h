// The atlas as JPEG tiles: each picture by itself, only the squares that hold samples, by several threads.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "codec/atlas_encoder.h"
#include "codec/jpeg_tile.h"
#include "codec/scale_search.h"

namespace tessera::codec {

// A small part of the picture stands for the whole where the scale is searched and the codes are made.
class JpegEncoder final : public AtlasEncoder {
 public:
  static StatusOr<std::unique_ptr<JpegEncoder>> create(uint32_t width, uint32_t height);

  StatusOr<AccessUnit> encode(FrameNumber frame, const AtlasPicture& picture, double budget_bits,
                              bool key_frame) override;
  const std::string& choice() const override { return choice_; }

 private:
  struct Plan {
    double scale = 0;
    JpegCodes codes;
    double expected_bits = 0;
  };
  struct Coded {
    std::vector<uint8_t> tables;
    std::vector<std::vector<uint8_t>> tiles;
    double bits() const;
  };

  JpegEncoder(uint32_t width, uint32_t height);
  void gather_tiles(const AtlasPicture& picture);
  StatusOr<Plan> plan_for(double bits);
  StatusOr<Coded> compress(const Plan& plan);
  StatusOr<Coded> compress_within(double budget_bits);

  const uint32_t width_, height_;
  std::string choice_;
  Occupancy all_;                            // for pictures without gaps
  std::vector<JpegCompressor> compressors_;  // one a worker
  // Of the current picture, kept for their memory:
  std::vector<uint32_t> mcus_;
  std::vector<YuvImage> tiles_;
  YuvImage sample_;
  double sample_share_ = 1;  // of the squares
  // From picture to picture:
  ScaleSearch search_;
  double whole_to_sample_ = 1;  // bits of a square in the picture, divided by those of one in its sample
};

}  // namespace tessera::codec
