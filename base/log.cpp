#include "base/log.h"

#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_color_sinks.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/utf8.h"

namespace tessera {
namespace {

// Before an event whose fields are JSON already, on its way through spdlog, which carries plain text.
constexpr char kJsonMark = '\x1e';

std::atomic<LogFormat> format_in_force = LogFormat::text;

bool has_controls(absl::string_view text) {
  for (size_t i = 0; i < text.size(); ++i) {
    const auto c = static_cast<unsigned char>(text[i]);
    const auto next = static_cast<unsigned char>(i + 1 < text.size() ? text[i + 1] : 0);
    if (c < 0x20 || c == 0x7f || (c == 0xc2 && next >= 0x80 && next < 0xa0)) return true;  // C0, DEL, C1
  }
  return false;
}

// As JSON has it, which keeps a line whole in text as well. Left alone, JSON escapes of the controls C0 only.
std::string json_text(absl::string_view text) {
  return nlohmann::json(std::string(text))
      .dump(-1, ' ', has_controls(text), nlohmann::json::error_handler_t::replace);
}

// As it is, unless it has control characters or some that mean something, or is no UTF-8.
std::string as_text(absl::string_view text, absl::string_view special) {
  const bool plain = !text.empty() && !has_controls(text) && text.find_first_of(special) == text.npos &&
                     utf8_prefix({text.data(), text.size()}).size() == text.size();
  return plain ? std::string(text) : json_text(text);
}

// %* in the pattern: what is logged, whoever logs it.
class PayloadFlag final : public spdlog::custom_flag_formatter {
 public:
  explicit PayloadFlag(LogFormat format) : format_(format) {}
  std::unique_ptr<custom_flag_formatter> clone() const override {
    return std::make_unique<PayloadFlag>(format_);
  }
  void format(const spdlog::details::log_msg& message, const std::tm&, spdlog::memory_buf_t& out) override {
    const absl::string_view payload(message.payload.data(), message.payload.size());
    std::string text;
    if (format_ == LogFormat::text) {
      text = as_text(payload, "");
    } else if (!payload.empty() && payload[0] == kJsonMark) {
      text = std::string(payload.substr(1));
    } else {
      text = absl::StrCat("\"event\":", json_text(payload));
    }
    out.append(text.data(), text.data() + text.size());
  }

 private:
  LogFormat format_;
};

}  // namespace

void init_logging(std::string_view level, LogFormat format) {
  format_in_force = format;
  auto logger = spdlog::get("tessera");
  if (!logger) logger = spdlog::stderr_color_mt("tessera");
  auto formatter = std::make_unique<spdlog::pattern_formatter>();
  formatter->add_flag<PayloadFlag>('*', format);
  formatter->set_pattern(format == LogFormat::json ? R"({"time":"%Y-%m-%dT%H:%M:%S.%e%z","level":"%l",%*})"
                                                   : "%Y-%m-%dT%H:%M:%S.%e %^%l%$ %*");
  logger->set_formatter(std::move(formatter));
  const auto parsed = spdlog::level::from_str(std::string(level));
  const bool unknown = parsed == spdlog::level::off && level != "off";
  logger->set_level(unknown ? spdlog::level::info : parsed);
  spdlog::set_default_logger(std::move(logger));
}

void log_event(spdlog::level::level_enum level, std::string_view event,
               std::initializer_list<LogField> fields) {
  if (!spdlog::should_log(level)) return;
  const bool json = format_in_force == LogFormat::json;
  std::string payload(event);
  if (json) payload = absl::StrCat(std::string(1, kJsonMark), "\"event\":", json_text(payload));
  for (const LogField& field : fields) {
    const std::string key(field.key);
    if (json) {
      absl::StrAppend(&payload, ",\"", key, "\":", field.number ? field.value : json_text(field.value));
    } else {
      absl::StrAppend(&payload, " ", key, "=", as_text(field.value, " \"=\\"));
    }
  }
  spdlog::log(level, spdlog::string_view_t(payload.data(), payload.size()));
}

}  // namespace tessera
