#include "codec/ffmpeg_support.h"

#include <array>
#include <mutex>

#include "base/log.h"

namespace tessera::codec {
namespace {

// FFmpeg hands the reason of a failure only to its log callback.
thread_local std::string last_error;

void on_log(void* context, int level, const char* format, va_list arguments) {
  if (level > AV_LOG_WARNING) return;
  std::array<char, 512> line{};
  int print_prefix = 0;  // it would be an address
  av_log_format_line2(context, level, format, arguments, line.data(), static_cast<int>(line.size()),
                      &print_prefix);
  std::string text = line.data();
  while (!text.empty() && text.back() == '\n') text.pop_back();
  spdlog::debug("FFmpeg: {}", text);
  if (level <= AV_LOG_ERROR) last_error = std::move(text);
}

}  // namespace

void route_ffmpeg_log() {
  static std::once_flag once;
  std::call_once(once, [] { av_log_set_callback(on_log); });
}

void forget_ffmpeg_error() {
  last_error.clear();
}

std::string ffmpeg_error(int code) {
  std::array<char, AV_ERROR_MAX_STRING_SIZE> text{};
  av_strerror(code, text.data(), text.size());
  return last_error.empty() ? std::string(text.data()) : std::string(text.data()) + ": " + last_error;
}

}  // namespace tessera::codec
