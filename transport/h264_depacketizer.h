// RTP payloads back to H.264 access units (RFC 6184: single NAL units, STAP-A, FU-A). Safe for untrusted
// input.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "transport/depacketizer.h"

namespace tessera::transport {

// A NAL unit with a hole is left out. A frame surely starts with an SPS or a delimiter.
class H264Depacketizer final : public Depacketizer {
 public:
  using Depacketizer::Depacketizer;

 private:
  bool starts_frame(std::span<const uint8_t> payload) const override;
  void add_payload(std::span<const uint8_t> payload) override;
  void damaged() override;
  void finish() override;
  void add_aggregate(std::span<const uint8_t> payload);
  void add_fragment(std::span<const uint8_t> payload);
  void add_nal(std::span<const uint8_t> nal);
  void drop_fragments();

  std::optional<size_t> fragments_begin_;  // where the unfinished FU-A unit starts in the access unit
};

}  // namespace tessera::transport
