// Conventional streaming, for the baselines: whole pictures as H.264 over an emulated link of their own, with
// the same rate, delay, jitter and loss as the atlas and meta packets of the method under test.
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "base/frame_number.h"
#include "base/image.h"
#include "base/status.h"
#include "base/view.h"
#include "bench/link.h"
#include "codec/video_decoder.h"
#include "codec/video_encoder.h"

namespace tessera::bench {

struct StreamedPicture {
  FrameNumber frame = 0;
  TimeNs pose_ns = 0;  // of the pose for which it was rendered
  View view;
  Image8 color;              // decoded
  std::vector<float> depth;  // uncoded and free of cost (in the baseline's favour); may be empty
};

struct PictureStreamSettings {
  uint32_t width = 0, height = 0;  // even
  double frames_per_second = 30;
  double bitrate_bps = 20e6;
  bool coded = true;  // false: colour arrives unchanged and costs no bits
  LinkSettings link;
};

class PictureStream {
 public:
  static StatusOr<std::unique_ptr<PictureStream>> create(const PictureStreamSettings& settings);

  // Encodes and sends. `now` never decreases over all calls; it is when the picture is ready for the network.
  Status send(TimeNs now, StreamedPicture picture);
  // The newest picture that has arrived and been decoded by `now`; nullptr before the first. Valid until the
  // next call.
  StatusOr<const StreamedPicture*> newest(TimeNs now);

  uint64_t bytes_sent() const { return bytes_sent_; }
  uint64_t frames_sent() const { return frames_sent_; }

 private:
  explicit PictureStream(const PictureStreamSettings& settings) : settings_(settings), link_(settings.link) {}
  StatusOr<std::vector<uint8_t>> encode(TimeNs now, FrameNumber frame, const Image8& color);
  Status receive(const Delivery& delivery);

  PictureStreamSettings settings_;
  Link link_;
  std::unique_ptr<codec::VideoEncoder> encoder_;
  std::unique_ptr<codec::VideoDecoder> decoder_;
  std::deque<StreamedPicture> under_way_;  // in sending order
  std::optional<StreamedPicture> newest_;
  uint64_t bytes_sent_ = 0, frames_sent_ = 0;
};

}  // namespace tessera::bench
