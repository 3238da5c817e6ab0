// Any bytes as a coded atlas, JPEG and raw. What decodes has the size that its header says.
#include <cstdlib>

#include "codec/atlas_decoder.h"
#include "codec/picture_packet.h"

using namespace tessera;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  // Small, so that inputs differ in more than in how long they take.
  constexpr codec::PictureLimits kLimits{512, 512};
  for (const AtlasCodec kind : {AtlasCodec::jpeg, AtlasCodec::raw}) {
    const auto decoder = *codec::AtlasDecoder::create(kind, kLimits.width, kLimits.height);
    const auto frame = decoder->decode({data, size});
    if (!frame.ok()) continue;
    const auto header = codec::read_header({data, size}, kind, kLimits);
    if (!header.ok() || frame->frame != header->frame || frame->picture.width != header->width ||
        frame->picture.height != header->height)
      std::abort();
    volatile uint8_t last = 0;  // the planes are all there
    last = frame->picture.y[size_t{header->height - 1} * frame->picture.y_stride + header->width - 1];
    last =
        frame->picture.v[size_t{header->height / 2 - 1} * frame->picture.uv_stride + header->width / 2 - 1];
    (void)last;
  }
  return 0;
}
