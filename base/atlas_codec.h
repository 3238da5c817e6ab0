// How the atlas is coded on its way to a client.
#pragma once

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <optional>
#include <string_view>
#include <utility>

namespace tessera {

// The numbers are the wire's (docs/protocol.md).
enum class AtlasCodec : uint8_t {
  h264 = 0,  // video: a picture builds on the one before
  jpeg = 1,  // each picture by itself; texels without samples cost next to nothing
  raw = 2,   // 12 bits a texel, whatever the budget: for tests
};

constexpr std::pair<AtlasCodec, std::string_view> kAtlasCodecs[] = {
    {AtlasCodec::h264, "h264"}, {AtlasCodec::jpeg, "jpeg"}, {AtlasCodec::raw, "raw"}};

constexpr std::string_view name_of(AtlasCodec codec) {
  return kAtlasCodecs[static_cast<size_t>(codec)].second;
}
constexpr std::optional<AtlasCodec> atlas_codec_from(std::string_view name) {
  for (const auto& [codec, known] : kAtlasCodecs)
    if (known == name) return codec;
  return std::nullopt;
}
constexpr std::optional<AtlasCodec> atlas_codec_from(uint8_t wire_number) {
  if (wire_number >= std::size(kAtlasCodecs)) return std::nullopt;
  return static_cast<AtlasCodec>(wire_number);
}

}  // namespace tessera
