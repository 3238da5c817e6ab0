#include "base/log.h"

#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_color_sinks.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_split.h"

namespace tessera {
namespace {

// Between the parts of an event on its way through spdlog, which carries plain text.
constexpr char kFieldMark = '\x1e', kTextMark = '\x1f';

bool is_control(char c) {
  return static_cast<unsigned char>(c) < 0x20 || c == 0x7f;
}

// As JSON has it, which keeps a line whole in text as well.
std::string quoted(absl::string_view text) {
  return nlohmann::json(std::string(text)).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string as_text(absl::string_view value, absl::string_view special) {
  const bool plain = !value.empty() && std::none_of(value.begin(), value.end(), [&](char c) {
    return is_control(c) || special.find(c) != special.npos;
  });
  return plain ? std::string(value) : quoted(value);
}

// %* in the pattern: the event with its fields.
class EventFlag final : public spdlog::custom_flag_formatter {
 public:
  explicit EventFlag(LogFormat format) : format_(format) {}
  std::unique_ptr<custom_flag_formatter> clone() const override {
    return std::make_unique<EventFlag>(format_);
  }
  void format(const spdlog::details::log_msg& message, const std::tm&, spdlog::memory_buf_t& out) override {
    const absl::string_view payload(message.payload.data(), message.payload.size());
    const std::vector<absl::string_view> parts = absl::StrSplit(payload, kFieldMark);
    const bool json = format_ == LogFormat::json;
    std::string line = json ? absl::StrCat("\"event\":", quoted(parts[0])) : as_text(parts[0], "");
    for (size_t i = 1; i < parts.size(); ++i) {
      // key, mark, value of a number; key, mark, mark, value of a text
      std::pair<absl::string_view, absl::string_view> field =
          absl::StrSplit(parts[i], absl::MaxSplits(kTextMark, 1));
      const bool text = !field.second.empty() && field.second.front() == kTextMark;
      if (text) field.second.remove_prefix(1);
      if (json) {
        absl::StrAppend(&line, ",\"", field.first,
                        "\":", text ? quoted(field.second) : std::string(field.second));
      } else {
        absl::StrAppend(&line, " ", field.first, "=", as_text(field.second, " \"=\\"));
      }
    }
    out.append(line.data(), line.data() + line.size());
  }

 private:
  LogFormat format_;
};

}  // namespace

void init_logging(std::string_view level, LogFormat format) {
  auto logger = spdlog::get("tessera");
  if (!logger) logger = spdlog::stderr_color_mt("tessera");
  auto formatter = std::make_unique<spdlog::pattern_formatter>();
  formatter->add_flag<EventFlag>('*', format);
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
  std::string payload(event);
  for (const LogField& field : fields) {
    std::string value = field.value;
    std::replace_if(
        value.begin(), value.end(), [](char c) { return c == kFieldMark || c == kTextMark; }, '?');
    payload += kFieldMark;
    payload += field.key;
    payload += kTextMark;
    if (!field.number) payload += kTextMark;
    payload += value;
  }
  spdlog::log(level, spdlog::string_view_t(payload.data(), payload.size()));
}

}  // namespace tessera
