// The atlas as it is, 12 bits a texel: what tests compare the other codecs with. The decoder is safe for
// untrusted input.
#pragma once

#include "codec/atlas_decoder.h"
#include "codec/atlas_encoder.h"
#include "codec/picture_packet.h"

namespace tessera::codec {

class RawEncoder final : public AtlasEncoder {
 public:
  static StatusOr<std::unique_ptr<RawEncoder>> create(uint32_t width, uint32_t height);

  // Takes no notice of the budget.
  StatusOr<AccessUnit> encode(FrameNumber frame, const AtlasPicture& picture, double budget_bits,
                              bool key_frame) override;
  const std::string& choice() const override { return choice_; }

 private:
  RawEncoder(uint32_t width, uint32_t height) : width_(width), height_(height) {}

  const uint32_t width_, height_;
  const std::string choice_ = "none: raw planes";
};

class RawDecoder final : public AtlasDecoder {
 public:
  RawDecoder(uint32_t max_width, uint32_t max_height) : limits_{max_width, max_height} {}

  StatusOr<DecodedFrame> decode(std::span<const uint8_t> packet) override;

 private:
  const PictureLimits limits_;
  std::vector<uint8_t> planes_;
};

}  // namespace tessera::codec
