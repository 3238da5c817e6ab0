#include "bench/picture_stream.h"

#include <algorithm>

#include "codec/yuv.h"

namespace tessera::bench {
namespace {

constexpr double kKeyFrameBudgets = 4;  // docs/architecture.md: the same rule as for the atlas
constexpr double kSmallestBudget = 0.25;

}  // namespace

StatusOr<std::unique_ptr<PictureStream>> PictureStream::create(const PictureStreamSettings& settings) {
  std::unique_ptr<PictureStream> stream(new PictureStream(settings));
  if (!settings.coded) return stream;
  TESSERA_ASSIGN_OR_RETURN(stream->encoder_,
                           codec::VideoEncoder::create({.width = settings.width,
                                                        .height = settings.height,
                                                        .frames_per_second = settings.frames_per_second,
                                                        .bitrate_bps = settings.bitrate_bps}));
  TESSERA_ASSIGN_OR_RETURN(stream->decoder_, codec::VideoDecoder::create());
  return stream;
}

// A frame's share of the rate, less half of what still waits in front of the link: the queue that a key frame
// leaves behind drains within a few frames.
StatusOr<std::vector<uint8_t>> PictureStream::encode(TimeNs now, FrameNumber frame, const Image8& color) {
  const double share = settings_.bitrate_bps / settings_.frames_per_second;
  const double queued = 8.0 * static_cast<double>(link_.queued_bytes(now));
  const bool key = frames_sent_ == 0;
  const double budget =
      key ? kKeyFrameBudgets * share : std::max(kSmallestBudget * share, share - queued / 2);
  const YuvImage yuv = codec::rgb_to_yuv(color);
  TESSERA_ASSIGN_OR_RETURN(codec::AccessUnit unit, encoder_->encode(frame, codec::view_of(yuv), budget, key));
  return std::move(unit.bytes);
}

Status PictureStream::send(TimeNs now, StreamedPicture picture) {
  std::vector<uint8_t> payload;
  if (settings_.coded) {
    TESSERA_ASSIGN_OR_RETURN(payload, encode(now, picture.frame, picture.color));
  }
  ++frames_sent_;
  bytes_sent_ += payload.size();
  under_way_.push_back(std::move(picture));
  link_.send(now, Channel::meta, std::move(payload));  // in order: each picture refers to the one before
  return absl::OkStatus();
}

Status PictureStream::receive(const Delivery& delivery) {
  newest_ = std::move(under_way_.front());
  under_way_.pop_front();
  if (!settings_.coded) return absl::OkStatus();
  TESSERA_ASSIGN_OR_RETURN(const codec::DecodedFrame decoded, decoder_->decode(delivery.payload));
  newest_->color = codec::yuv_to_rgb(decoded.picture);
  return absl::OkStatus();
}

StatusOr<const StreamedPicture*> PictureStream::newest(TimeNs now) {
  for (const Delivery& delivery : link_.poll(now)) TESSERA_RETURN_IF_ERROR(receive(delivery));
  return newest_ ? &*newest_ : nullptr;
}

}  // namespace tessera::bench
