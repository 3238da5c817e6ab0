#include "codec/video_encoder.h"

#include <algorithm>
#include <iterator>

#include "base/log.h"
#include "codec/libav_encoder.h"

namespace tessera::codec {
namespace {

// FFmpeg's h264_vaapi fixes its rate when it is opened, so it cannot keep a budget that changes from frame to
// frame.
constexpr const char* kNoVaapi = "FFmpeg's h264_vaapi cannot follow a budget per frame";

Status check(const EncoderSettings& s) {
  if (s.width == 0 || s.height == 0 || s.width % 2 != 0 || s.height % 2 != 0 || s.width > 16384 ||
      s.height > 16384)
    return absl::InvalidArgumentError(
        absl::StrFormat("video of %ux%u: both sides must be even, 2..16384", s.width, s.height));
  if (!(s.frames_per_second >= 1 && s.frames_per_second <= 1000))
    return absl::InvalidArgumentError(absl::StrFormat("%g frames/s: must be 1..1000", s.frames_per_second));
  if (!(s.bitrate_bps >= 1000 && s.bitrate_bps <= 2e9))
    return absl::InvalidArgumentError(absl::StrFormat("%g bit/s: must be 1e3..2e9", s.bitrate_bps));
  // libx264 prints to standard error by itself if it does not know a preset.
  constexpr const char* kPresets[] = {"ultrafast", "superfast", "veryfast", "faster",   "fast",
                                      "medium",    "slow",      "slower",   "veryslow", "placebo"};
  if (std::find(std::begin(kPresets), std::end(kPresets), s.preset) == std::end(kPresets))
    return absl::InvalidArgumentError(absl::StrCat("preset `", s.preset, "`: x264 has ultrafast .. placebo"));
  return absl::OkStatus();
}

StatusOr<std::unique_ptr<VideoEncoder>> open(const Flavour& flavour, const EncoderSettings& settings,
                                             std::string choice) {
  TESSERA_ASSIGN_OR_RETURN(auto encoder, LibavEncoder::open(flavour, settings));
  spdlog::debug("video encoder: {}", choice);
  encoder->set_choice(std::move(choice));
  return encoder;
}

}  // namespace

StatusOr<std::unique_ptr<VideoEncoder>> VideoEncoder::create(const EncoderSettings& settings) {
  TESSERA_RETURN_IF_ERROR(check(settings));
  route_ffmpeg_log();
  if (settings.encoder == "x264") return open(kX264, settings, "libx264 (asked for)");
  if (settings.encoder == "nvenc")
    return open(kNvenc, settings, "h264_nvenc (asked for; this path is not tested)");
  if (settings.encoder == "vaapi")
    return absl::UnavailableError(absl::StrCat("vaapi: ", kNoVaapi, "; use x264"));
  if (settings.encoder != "auto")
    return absl::InvalidArgumentError(
        absl::StrCat("encoder `", settings.encoder, "`: must be auto, x264, nvenc or vaapi"));
  auto nvenc = open(kNvenc, settings, "h264_nvenc (found by probing; this path is not tested)");
  if (nvenc.ok()) return nvenc;
  return open(kX264, settings,
              absl::StrCat("libx264 (no NVENC: ", nvenc.status().message(), "; no VAAPI: ", kNoVaapi, ")"));
}

}  // namespace tessera::codec
