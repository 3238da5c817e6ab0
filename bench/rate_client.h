// A frame that is rendered once, streamed at one more bit rate: coded as a session codes it beside its meta
// packet, and decoded as its client does.
#pragma once

#include <memory>

#include "bench/settings.h"
#include "codec/atlas_decoder.h"
#include "codec/atlas_encoder.h"
#include "server/rate_split.h"

namespace tessera::bench {

class RateClient {
 public:
  // H.264; the atlas's size and the frame rate are those of the settings.
  static StatusOr<RateClient> create(const LoopbackSettings& settings, double bitrate_mbps);

  // The coded atlas's size in bits; the first frame is a key frame.
  StatusOr<double> serve(FrameNumber frame, const YuvView& atlas, double meta_bits);
  // As decoded, until the next serve().
  const YuvView& atlas() const { return decoded_; }

 private:
  server::RateSplit rate_;
  server::BitBalance balance_;
  std::unique_ptr<codec::AtlasEncoder> encoder_;
  std::unique_ptr<codec::AtlasDecoder> decoder_;
  YuvView decoded_;
  bool first_ = true;
};

}  // namespace tessera::bench
