// Logging through spdlog. Programs call init_logging() once, before they start threads; libraries just log,
// on any thread. Each event is one line: lines with control characters are quoted, so that a peer's
// text can neither break a line nor forge one.
#pragma once

#include <spdlog/spdlog.h>

#include <initializer_list>
#include <string>
#include <string_view>
#include <type_traits>

#include "absl/strings/str_cat.h"

namespace tessera {

enum class LogFormat { text, json };

// Log lines go to standard error, so that standard output stays machine-readable. `level` is one of
// trace, debug, info, warn, error, off; anything else means info.
//   text: 2026-01-31T12:00:00.000 info client connected session=3 peer=127.0.0.1:4711
//   json: {"time":"…","level":"info","event":"client connected","session":3,"peer":"127.0.0.1:4711"}
void init_logging(std::string_view level, LogFormat format = LogFormat::text);

// One `key=value` of an event.
struct LogField {
  template <class T>
  LogField(std::string_view k, const T& v) : key(k), value(absl::StrCat(v)) {
    if constexpr (std::is_arithmetic_v<T>) number = v - v == 0;  // JSON knows no infinities
  }
  std::string_view key;  // [a-z_]+
  std::string value;
  bool number = false;
};

// `event` is the same text every time; what differs lies in the fields.
void log_event(spdlog::level::level_enum level, std::string_view event,
               std::initializer_list<LogField> fields);

}  // namespace tessera
