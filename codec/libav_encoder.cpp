#include "codec/libav_encoder.h"

#include <algorithm>
#include <cmath>

#include "codec/annex_b.h"

extern "C" {
#include <libavutil/opt.h>
}

namespace tessera::codec {
namespace {

// libx264 takes rates and sizes in units of 1000 bits.
constexpr double kRateUnit = 1000;

// libx264 keeps a margin to its buffer (1 / rows, at least 5 %) and has never been seen above 0.97 of it.
constexpr double kUseOfMargin = 1.05;

void set_option(AVCodecContext& context, const char* name, const std::string& value) {
  av_opt_set(context.priv_data, name, value.c_str(), 0);
}

void configure_x264(AVCodecContext& context, const EncoderSettings& settings) {
  set_option(context, "preset", settings.preset);
  set_option(context, "tune", "zerolatency");
  set_option(context, "forced-idr", "1");
  // The quantiser that a picture converges to when it stands still: SSIM 0.998, then next to no bits.
  set_option(context, "crf", "10");
  // Each frame is as good as its budget allows, so no quantiser curve over time (qcomp=1). Measured on still,
  // changing and moving atlases: psy=0 and a weak deblocking filter raise SSIM by 0.002, 8x8dct by 0.006 (so
  // the profile is High).
  set_option(
      context, "x264-params",
      "cabac=0:ref=1:scenecut=0:mbtree=0:weightp=0:qcomp=1:sliced-threads=0:8x8dct=1:psy=0:deblock=-2,-2");
}

void configure_nvenc(AVCodecContext& context, const EncoderSettings&) {
  set_option(context, "preset", "p4");
  set_option(context, "tune", "ull");
  set_option(context, "rc", "cbr");
  set_option(context, "coder", "cavlc");
  set_option(context, "delay", "0");
  set_option(context, "zerolatency", "1");
  set_option(context, "forced-idr", "1");
  set_option(context, "no-scenecut", "1");
}

}  // namespace

const Flavour kX264 = {"libx264", configure_x264, false, true};
const Flavour kNvenc = {"h264_nvenc", configure_nvenc, true, false};

StatusOr<std::unique_ptr<LibavEncoder>> LibavEncoder::open(const Flavour& flavour,
                                                           const EncoderSettings& settings) {
  std::unique_ptr<LibavEncoder> encoder(new LibavEncoder(flavour, settings));
  encoder->frame_.reset(av_frame_alloc());
  encoder->packet_.reset(av_packet_alloc());
  if (!encoder->frame_ || !encoder->packet_) return absl::ResourceExhaustedError("FFmpeg: out of memory");
  TESSERA_RETURN_IF_ERROR(encoder->reopen(settings.bitrate_bps / settings.frames_per_second));
  return encoder;
}

Status LibavEncoder::reopen(double budget_bits) {
  const AVCodec* codec = avcodec_find_encoder_by_name(flavour_.codec);
  if (!codec) return absl::UnavailableError(absl::StrCat("FFmpeg was built without ", flavour_.codec));
  context_.reset(avcodec_alloc_context3(codec));
  if (!context_) return absl::ResourceExhaustedError("FFmpeg: out of memory");
  AVCodecContext& c = *context_;
  c.width = static_cast<int>(settings_.width);
  c.height = static_cast<int>(settings_.height);
  c.pix_fmt = AV_PIX_FMT_YUV420P;
  c.framerate = av_d2q(settings_.frames_per_second, 100000);
  c.time_base = av_inv_q(c.framerate);
  c.color_range = AVCOL_RANGE_MPEG;
  c.colorspace = AVCOL_SPC_BT709;
  c.color_primaries = AVCOL_PRI_BT709;
  c.color_trc = AVCOL_TRC_BT709;
  c.chroma_sample_location = AVCHROMA_LOC_CENTER;
  c.gop_size = -1;
  c.max_b_frames = 0;
  c.refs = 1;
  c.thread_count = 1;
  flavour_.configure(c, settings_);
  set_budget(budget_bits);
  c.rc_initial_buffer_occupancy = c.rc_buffer_size;
  forget_ffmpeg_error();
  if (const int code = avcodec_open2(&c, codec, nullptr); code < 0)
    return absl::UnavailableError(absl::StrCat(flavour_.codec, ": ", ffmpeg_error(code)));
  fresh_ = true;
  return absl::OkStatus();
}

// Every frame gets a buffer of its own size, which refills completely from one to the next. libx264 cuts what
// is in the buffer down to the new size before it starts a frame, so a smaller budget holds at once; a larger
// one holds from the frame after on, because the buffer filled up only to the old size.
void LibavEncoder::set_budget(double budget_bits) {
  const double units = std::floor((budget_bits * kUseOfMargin - kTagBits) / kRateUnit);
  const double size = kRateUnit * std::clamp(units, 1.0, 2e6);
  context_->rc_buffer_size = static_cast<int>(size);
  context_->rc_max_rate = static_cast<int64_t>(std::ceil(size * settings_.frames_per_second));
  if (flavour_.constant_bit_rate) context_->bit_rate = context_->rc_max_rate;
}

StatusOr<AccessUnit> LibavEncoder::encode(FrameNumber frame, const AtlasPicture& picture, double budget_bits,
                                          bool key_frame) {
  if (!(budget_bits > 0))
    return absl::InvalidArgumentError(absl::StrFormat("encode: a budget of %g bits", budget_bits));
  key_frame = key_frame || fresh_;
  if (key_frame && !last_was_key_frame_ && flavour_.reopen_for_key_frames)
    TESSERA_RETURN_IF_ERROR(reopen(budget_bits));
  set_budget(budget_bits);
  TESSERA_RETURN_IF_ERROR(fill(picture.yuv, key_frame));
  TESSERA_ASSIGN_OR_RETURN(const std::vector<uint8_t> bytes, send_and_receive());

  AccessUnit unit;
  unit.frame = frame;
  unit.key_frame = inspect(bytes).key_frame;
  unit.bytes = with_tag(bytes, {frame, unit.key_frame ? frame : last_frame_});
  last_frame_ = frame;
  last_was_key_frame_ = unit.key_frame;
  fresh_ = false;
  return unit;
}

Status LibavEncoder::fill(const YuvView& picture, bool key_frame) {
  if (picture.width != settings_.width || picture.height != settings_.height)
    return absl::InvalidArgumentError(
        absl::StrFormat("encode: the picture is %ux%u, the encoder was made for %ux%u", picture.width,
                        picture.height, settings_.width, settings_.height));
  AVFrame& f = *frame_;
  f.width = context_->width;
  f.height = context_->height;
  f.format = context_->pix_fmt;
  // The encoder may still hold the buffer of the frame before.
  if (!f.buf[0] || av_frame_make_writable(&f) < 0)
    if (const int code = av_frame_get_buffer(&f, 0); code < 0)
      return absl::ResourceExhaustedError(absl::StrCat("av_frame_get_buffer: ", ffmpeg_error(code)));
  const uint8_t* planes[] = {picture.y, picture.u, picture.v};
  for (int plane = 0; plane < 3; ++plane) {
    const uint32_t stride = plane == 0 ? picture.y_stride : picture.uv_stride;
    const uint32_t width = plane == 0 ? picture.width : picture.width / 2;
    const uint32_t height = plane == 0 ? picture.height : picture.height / 2;
    for (uint32_t row = 0; row < height; ++row)
      std::copy_n(planes[plane] + size_t{row} * stride, width,
                  f.data[plane] + ptrdiff_t{row} * f.linesize[plane]);
  }
  f.pts = pts_++;
  f.pict_type = key_frame ? AV_PICTURE_TYPE_I : AV_PICTURE_TYPE_P;
  return absl::OkStatus();
}

StatusOr<std::vector<uint8_t>> LibavEncoder::send_and_receive() {
  forget_ffmpeg_error();
  if (const int code = avcodec_send_frame(context_.get(), frame_.get()); code < 0)
    return absl::InternalError(absl::StrCat("avcodec_send_frame: ", ffmpeg_error(code)));
  if (const int code = avcodec_receive_packet(context_.get(), packet_.get()); code < 0)
    return absl::InternalError(absl::StrCat("avcodec_receive_packet: ", ffmpeg_error(code)));
  std::vector<uint8_t> bytes(packet_->data, packet_->data + packet_->size);
  av_packet_unref(packet_.get());
  return bytes;
}

}  // namespace tessera::codec
