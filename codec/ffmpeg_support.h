// FFmpeg's objects with owners, its errors as text, its log in ours.
#pragma once

#include <memory>
#include <string>

extern "C" {
#include <libavcodec/avcodec.h>
}

namespace tessera::codec {

struct AvDeleter {
  void operator()(AVCodecContext* p) const { avcodec_free_context(&p); }
  void operator()(AVFrame* p) const { av_frame_free(&p); }
  void operator()(AVPacket* p) const { av_packet_free(&p); }
};
using AvCodecContext = std::unique_ptr<AVCodecContext, AvDeleter>;
using AvFrame = std::unique_ptr<AVFrame, AvDeleter>;
using AvPacket = std::unique_ptr<AVPacket, AvDeleter>;

// FFmpeg prints to standard error by itself, also what is normal for us (a probe that finds nothing, damaged
// input). From the first call on, the whole process's FFmpeg messages go to our log at level debug.
void route_ffmpeg_log();

// An FFmpeg error code in words, with this thread's last FFmpeg error message if there was one since
// forget_ffmpeg_error().
std::string ffmpeg_error(int code);
void forget_ffmpeg_error();

}  // namespace tessera::codec
