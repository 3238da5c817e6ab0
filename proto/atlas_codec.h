// The atlas's codec in control messages.
#pragma once

#include <optional>

#include "base/atlas_codec.h"
#include "tessera/v1/control.pb.h"

namespace tessera {

constexpr v1::AtlasCodec to_proto(AtlasCodec codec) {
  switch (codec) {
    case AtlasCodec::jpeg:
      return v1::ATLAS_CODEC_JPEG;
    case AtlasCodec::raw:
      return v1::ATLAS_CODEC_RAW;
    case AtlasCodec::h264:
      break;
  }
  return v1::ATLAS_CODEC_H264;
}

// None: unspecified, or of a later version.
constexpr std::optional<AtlasCodec> from_proto(v1::AtlasCodec codec) {
  for (const auto& [known, name] : kAtlasCodecs)
    if (to_proto(known) == codec) return known;
  return std::nullopt;
}

}  // namespace tessera
