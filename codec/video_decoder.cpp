#include "codec/video_decoder.h"

#include <cstring>
#include <vector>

#include "codec/annex_b.h"
#include "codec/ffmpeg_support.h"

namespace tessera::codec {

struct VideoDecoder::Impl {
  uint32_t max_width, max_height;
  AvCodecContext context;
  AvFrame frame;
  AvPacket packet;
  std::vector<uint8_t> input;            // with FFmpeg's padding
  std::optional<FrameNumber> reference;  // the last frame, while the chain behind it is intact
  bool too_large = false;
  bool wrong_format = false;

  Status reopen();
  Status admit(std::span<const uint8_t> access_unit, FrameTag& tag) const;
  Status decode_picture(std::span<const uint8_t> access_unit);
  static AVPixelFormat choose_format(AVCodecContext* context, const AVPixelFormat* formats);
};

// FFmpeg asks this when a stream's size or format becomes known, before it allocates anything for them.
AVPixelFormat VideoDecoder::Impl::choose_format(AVCodecContext* context, const AVPixelFormat* formats) {
  auto& self = *static_cast<Impl*>(context->opaque);
  self.too_large = static_cast<uint32_t>(context->width) > self.max_width ||
                   static_cast<uint32_t>(context->height) > self.max_height;
  if (self.too_large) return AV_PIX_FMT_NONE;
  for (; *formats != AV_PIX_FMT_NONE; ++formats)
    if (*formats == AV_PIX_FMT_YUV420P) return AV_PIX_FMT_YUV420P;
  self.wrong_format = true;
  return AV_PIX_FMT_NONE;
}

Status VideoDecoder::Impl::reopen() {
  const AVCodec* codec = avcodec_find_decoder(AV_CODEC_ID_H264);
  if (!codec) return absl::UnavailableError("FFmpeg was built without an H.264 decoder");
  context.reset(avcodec_alloc_context3(codec));
  if (!context) return absl::ResourceExhaustedError("FFmpeg: out of memory");
  context->opaque = this;
  context->get_format = choose_format;
  context->thread_count = 1;
  context->flags |= AV_CODEC_FLAG_LOW_DELAY;
  // Damage must show as an error, not be painted over.
  context->err_recognition = AV_EF_BITSTREAM | AV_EF_BUFFER | AV_EF_EXPLODE;
  context->error_concealment = 0;
  forget_ffmpeg_error();
  if (const int code = avcodec_open2(context.get(), codec, nullptr); code < 0)
    return absl::UnavailableError(absl::StrCat("avcodec_open2 (h264): ", ffmpeg_error(code)));
  return absl::OkStatus();
}

Status VideoDecoder::Impl::admit(std::span<const uint8_t> access_unit, FrameTag& tag) const {
  const AccessUnitInfo info = inspect(access_unit);
  if (!info.has_slice) return absl::InvalidArgumentError("access unit: no picture in it");
  if (!info.tag)
    return absl::InvalidArgumentError("access unit: no frame number (SEI user data with our UUID)");
  tag = *info.tag;
  if (info.key_frame) return absl::OkStatus();
  if (!reference)
    return absl::FailedPreconditionError(absl::StrFormat("frame %u: waiting for a key frame", tag.frame));
  if (tag.reference != *reference)
    return absl::FailedPreconditionError(absl::StrFormat(
        "frame %u builds on frame %u, but the last one decoded is %u", tag.frame, tag.reference, *reference));
  return absl::OkStatus();
}

Status VideoDecoder::Impl::decode_picture(std::span<const uint8_t> access_unit) {
  input.assign(access_unit.size() + AV_INPUT_BUFFER_PADDING_SIZE, 0);
  std::memcpy(input.data(), access_unit.data(), access_unit.size());
  av_packet_unref(packet.get());
  packet->data = input.data();
  packet->size = static_cast<int>(access_unit.size());
  too_large = wrong_format = false;
  forget_ffmpeg_error();
  int code = avcodec_send_packet(context.get(), packet.get());
  if (code >= 0) code = avcodec_receive_frame(context.get(), frame.get());
  if (too_large)
    return absl::ResourceExhaustedError(
        absl::StrFormat("the picture is larger than the limit of %ux%u", max_width, max_height));
  if (wrong_format) return absl::InvalidArgumentError("the video is not 8-bit 4:2:0 of limited range");
  if (code < 0) return absl::InvalidArgumentError(absl::StrCat("H.264: ", ffmpeg_error(code)));
  if (frame->decode_error_flags != 0 || (frame->flags & AV_FRAME_FLAG_CORRUPT) != 0)
    return absl::InvalidArgumentError("H.264: the picture is damaged");
  if (frame->format != AV_PIX_FMT_YUV420P || frame->width % 2 != 0 || frame->height % 2 != 0)
    return absl::InvalidArgumentError("the video is not 8-bit 4:2:0 of even size");
  return absl::OkStatus();
}

VideoDecoder::VideoDecoder(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
VideoDecoder::~VideoDecoder() = default;

StatusOr<std::unique_ptr<VideoDecoder>> VideoDecoder::create(uint32_t max_width, uint32_t max_height) {
  route_ffmpeg_log();
  auto impl = std::make_unique<Impl>();
  impl->max_width = max_width;
  impl->max_height = max_height;
  impl->frame.reset(av_frame_alloc());
  impl->packet.reset(av_packet_alloc());
  if (!impl->frame || !impl->packet) return absl::ResourceExhaustedError("FFmpeg: out of memory");
  TESSERA_RETURN_IF_ERROR(impl->reopen());
  return std::unique_ptr<VideoDecoder>(new VideoDecoder(std::move(impl)));
}

StatusOr<DecodedFrame> VideoDecoder::decode(std::span<const uint8_t> access_unit) {
  Impl& d = *impl_;
  FrameTag tag;
  Status status = d.admit(access_unit, tag);
  d.reference.reset();
  if (!status.ok()) return status;
  status = d.decode_picture(access_unit);
  if (!status.ok()) {
    // What a damaged picture leaves in FFmpeg's decoder survives avcodec_flush_buffers and spoils the next
    // key frame.
    TESSERA_RETURN_IF_ERROR(d.reopen());
    return status;
  }
  d.reference = tag.frame;
  const AVFrame& f = *d.frame;
  return DecodedFrame{
      tag.frame,
      {static_cast<uint32_t>(f.width), static_cast<uint32_t>(f.height), f.data[0], f.data[1], f.data[2],
       static_cast<uint32_t>(f.linesize[0]), static_cast<uint32_t>(f.linesize[1])}};
}

}  // namespace tessera::codec
