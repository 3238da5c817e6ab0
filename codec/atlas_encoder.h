// The atlas on its way to a client: H.264, JPEG, or (for tests) raw, behind one interface. Budgets are per
// frame, so that a frame never waits behind another one in the network.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/atlas_codec.h"
#include "base/frame_number.h"
#include "base/status.h"
#include "base/yuv.h"
#include "codec/occupancy.h"

namespace tessera::codec {

struct EncoderSettings {
  uint32_t width = 0, height = 0;  // even
  double frames_per_second = 30;
  double bitrate_bps = 18e6;
  // Of H.264 alone:
  std::string encoder = "auto";     // auto, x264, nvenc, vaapi
  std::string preset = "veryfast";  // of x264
};

struct AtlasPicture {
  YuvView yuv;
  const Occupancy* used = nullptr;  // of the picture's size; null: every texel holds a sample

  // NOLINTNEXTLINE(google-explicit-constructor): a picture without gaps is one, too.
  AtlasPicture(const YuvView& view, const Occupancy* occupancy = nullptr) : yuv(view), used(occupancy) {}
};

// One coded picture with its frame number. H.264: an access unit in Annex B, with the number in an SEI
// message (annex_b.h). Others: a picture packet (picture_packet.h).
struct AccessUnit {
  FrameNumber frame = 0;
  bool key_frame = false;  // decodes without those before
  std::vector<uint8_t> bytes;
};

// Not thread-safe.
class AtlasEncoder {
 public:
  // InvalidArgument: settings outside their range. Unavailable: see VideoEncoder.
  static StatusOr<std::unique_ptr<AtlasEncoder>> create(AtlasCodec codec, const EncoderSettings& settings);
  virtual ~AtlasEncoder() = default;

  // `budget_bits`: the size this frame may have (key frames of video: up to four times the frame budget; the
  // caller passes the number it can afford). The encoder aims below it and may exceed it only by its rounding
  // (tests: 10 %), or where the coarsest quantiser needs more; raw takes no notice of it. The first frame is
  // always a key frame; with JPEG and raw all of them are.
  virtual StatusOr<AccessUnit> encode(FrameNumber frame, const AtlasPicture& picture, double budget_bits,
                                      bool key_frame) = 0;
  // Which encoder runs and why, e.g. "libx264 (no NVENC: …; no VAAPI: …)".
  virtual const std::string& choice() const = 0;
};

}  // namespace tessera::codec
