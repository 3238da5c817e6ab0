#include "codec/atlas_encoder.h"

#include "codec/jpeg_encoder.h"
#include "codec/raw_codec.h"
#include "codec/video_encoder.h"

namespace tessera::codec {

StatusOr<std::unique_ptr<AtlasEncoder>> AtlasEncoder::create(AtlasCodec codec,
                                                             const EncoderSettings& settings) {
  switch (codec) {
    case AtlasCodec::h264:
      return VideoEncoder::create(settings);
    case AtlasCodec::jpeg:
      return JpegEncoder::create(settings.width, settings.height);
    case AtlasCodec::raw:
      return RawEncoder::create(settings.width, settings.height);
  }
  return absl::InvalidArgumentError("atlas codec: must be h264, jpeg or raw");
}

}  // namespace tessera::codec
