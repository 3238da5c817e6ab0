// One H.264 encoder of libavcodec behind VideoEncoder. What differs between encoders is in Flavour.
#pragma once

#include <memory>

#include "codec/ffmpeg_support.h"
#include "codec/video_encoder.h"

namespace tessera::codec {

struct Flavour {
  const char* codec;  // libavcodec's name
  // Sets private options on a context that has everything common.
  void (*configure)(AVCodecContext& context, const EncoderSettings& settings);
  // Also give each frame's budget as bit rate (constant bit rate), not only as buffer.
  bool constant_bit_rate;
  // A budget that grows takes effect one frame late (set_budget), too late for a key frame: it starts with a
  // new context.
  bool reopen_for_key_frames;
};
extern const Flavour kX264;
extern const Flavour kNvenc;  // written from FFmpeg's documentation; never run on such a device

class LibavEncoder final : public VideoEncoder {
 public:
  // Unavailable, with FFmpeg's reason, if this encoder cannot be opened here.
  static StatusOr<std::unique_ptr<LibavEncoder>> open(const Flavour& flavour,
                                                      const EncoderSettings& settings);

  StatusOr<AccessUnit> encode(FrameNumber frame, const AtlasPicture& picture, double budget_bits,
                              bool key_frame) override;
  const std::string& choice() const override { return choice_; }
  void set_choice(std::string choice) { choice_ = std::move(choice); }

 private:
  LibavEncoder(const Flavour& flavour, const EncoderSettings& settings)
      : flavour_(flavour), settings_(settings) {}

  Status reopen(double budget_bits);
  void set_budget(double budget_bits);
  Status fill(const YuvView& picture, bool key_frame);
  StatusOr<std::vector<uint8_t>> send_and_receive();

  const Flavour& flavour_;
  EncoderSettings settings_;
  std::string choice_;
  AvCodecContext context_;
  AvFrame frame_;
  AvPacket packet_;
  int64_t pts_ = 0;
  bool fresh_ = true;  // no frame since the context was opened
  bool last_was_key_frame_ = false;
  FrameNumber last_frame_ = 0;
};

}  // namespace tessera::codec
