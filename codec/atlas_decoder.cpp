#include "codec/atlas_decoder.h"

#include "codec/jpeg_decoder.h"
#include "codec/raw_codec.h"
#include "codec/video_decoder.h"

namespace tessera::codec {

StatusOr<std::unique_ptr<AtlasDecoder>> AtlasDecoder::create(AtlasCodec codec, uint32_t max_width,
                                                             uint32_t max_height) {
  switch (codec) {
    case AtlasCodec::h264:
      return VideoDecoder::create(max_width, max_height);
    case AtlasCodec::jpeg:
      return std::make_unique<JpegDecoder>(max_width, max_height);
    case AtlasCodec::raw:
      return std::make_unique<RawDecoder>(max_width, max_height);
  }
  return absl::InvalidArgumentError("atlas codec: must be h264, jpeg or raw");
}

}  // namespace tessera::codec
