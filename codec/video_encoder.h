// H.264 for the atlas: zero latency, CAVLC, one reference, no B-frames. Behind one interface: libx264, and
// NVENC or VAAPI where a device has them.
#pragma once

#include <memory>

#include "codec/atlas_encoder.h"

namespace tessera::codec {

// See AtlasEncoder. libx264: a budget that grows from one P-frame to the next is used from the frame after
// on; what the coarsest quantiser needs (about 0.01 bits a texel of noise, and 1000 bits) cannot be undercut.
class VideoEncoder : public AtlasEncoder {
 public:
  // Probes in the order NVENC, VAAPI, x264 for `auto`. What is not there is normal; choice() tells.
  static StatusOr<std::unique_ptr<VideoEncoder>> create(const EncoderSettings& settings);
};

}  // namespace tessera::codec
