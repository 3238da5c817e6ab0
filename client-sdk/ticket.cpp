#include "client-sdk/ticket.h"

#include <absl/strings/escaping.h>
#include <absl/strings/numbers.h>
#include <absl/strings/strip.h>

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <iterator>
#include <vector>

namespace tessera::client {
namespace {

constexpr absl::string_view kScheme = "tessera://", kAuthority = "ca=";

Status wrong(absl::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat(
      "ticket: ", what, "; it looks like tessera://HOST:PORT/TOKEN or tessera://HOST:PORT/TOKEN?ca=FILE"));
}

bool is_hex(absl::string_view text) {
  return std::ranges::all_of(text,
                             [](char c) { return absl::ascii_isxdigit(static_cast<unsigned char>(c)); });
}

// "HOST:PORT" or "[HOST]:PORT".
Status parse_endpoint(absl::string_view text, Ticket& ticket) {
  const size_t colon = text.rfind(':');
  if (colon == absl::string_view::npos) return wrong("no `:PORT` after the host");
  uint32_t port = 0;
  if (!absl::SimpleAtoi(text.substr(colon + 1), &port) || port == 0 || port > 65535)
    return wrong("the port is not a number from 1 to 65535");
  ticket.meta_port = static_cast<uint16_t>(port);
  absl::string_view host = text.substr(0, colon);
  const bool brackets = absl::ConsumePrefix(&host, "[") && absl::ConsumeSuffix(&host, "]");
  if (host.empty() || host.find_first_of("[]@/ ") != absl::string_view::npos)
    return wrong("the host is not one");
  if (!brackets && host.find(':') != absl::string_view::npos)
    return wrong("an IPv6 address goes in brackets");
  ticket.host = std::string(host);
  return absl::OkStatus();
}

Status parse_token(absl::string_view text, transport::SessionToken& token) {
  if (text.size() != 2 * token.size() || !is_hex(text))
    return wrong(absl::StrCat("the token is not ", 2 * token.size(), " hexadecimal digits"));
  std::ranges::copy(absl::HexStringToBytes(text), token.begin());
  return absl::OkStatus();
}

StatusOr<std::string> decode_percent(absl::string_view text) {
  std::string out;
  while (!text.empty()) {
    if (text[0] != '%') {
      out += text[0];
      text.remove_prefix(1);
      continue;
    }
    if (text.size() < 3 || !is_hex(text.substr(1, 2))) return wrong("a `%` without two hexadecimal digits");
    out += absl::HexStringToBytes(text.substr(1, 2));
    text.remove_prefix(3);
  }
  if (out.find('\0') != std::string::npos) return wrong("a file name with a zero byte");
  return out;
}

std::string encode_percent(absl::string_view text) {
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (absl::ascii_isalnum(byte) || absl::string_view("-._~/").find(c) != absl::string_view::npos) {
      out += c;
    } else {
      absl::StrAppendFormat(&out, "%%%02X", byte);
    }
  }
  return out;
}

StatusOr<std::vector<std::string>> resolve(const std::string& host) {
  boost::asio::io_context io;
  boost::asio::ip::tcp::resolver resolver(io);
  boost::system::error_code error;
  const auto found = resolver.resolve(host, "", error);
  if (error) return absl::UnavailableError(absl::StrCat("resolve `", host, "`: ", error.message()));
  std::vector<std::string> addresses;
  for (const auto& entry : found) addresses.push_back(entry.endpoint().address().to_string());
  return addresses;
}

}  // namespace

StatusOr<Ticket> parse_ticket(absl::string_view text) {
  if (!absl::ConsumePrefix(&text, kScheme)) return wrong("it does not begin with tessera://");
  Ticket ticket;
  const size_t slash = text.find('/');
  if (slash == absl::string_view::npos) return wrong("no `/TOKEN` after the port");
  TESSERA_RETURN_IF_ERROR(parse_endpoint(text.substr(0, slash), ticket));
  text.remove_prefix(slash + 1);
  const size_t question = text.find('?');
  TESSERA_RETURN_IF_ERROR(parse_token(text.substr(0, question), ticket.token));
  if (question == absl::string_view::npos) return ticket;
  text.remove_prefix(question + 1);
  if (!absl::ConsumePrefix(&text, kAuthority) || text.find_first_of("&#") != absl::string_view::npos)
    return wrong("`ca=FILE` alone may follow the `?`");
  TESSERA_ASSIGN_OR_RETURN(ticket.authority_file, decode_percent(text));
  return ticket;
}

std::string to_string(const Ticket& ticket) {
  const bool brackets = ticket.host.find(':') != std::string::npos;
  const absl::string_view token(reinterpret_cast<const char*>(ticket.token.data()), ticket.token.size());
  std::string text = absl::StrCat(kScheme, brackets ? "[" : "", ticket.host, brackets ? "]:" : ":",
                                  ticket.meta_port, "/", absl::BytesToHexString(token));
  if (ticket.authority_file) absl::StrAppend(&text, "?", kAuthority, encode_percent(*ticket.authority_file));
  return text;
}

StatusOr<std::unique_ptr<Connection>> connect(const Ticket& ticket, const transport::ClientSettings& client,
                                              DurationNs timeout_ns, const Clock& clock) {
  const TimeNs give_up = clock.now() + timeout_ns;
  ConnectionSettings settings{.meta_port = ticket.meta_port, .token = ticket.token, .client = client};
  if (ticket.authority_file) {
    TESSERA_ASSIGN_OR_RETURN(settings.tls,
                             transport::TlsContext::client({*ticket.authority_file, ticket.host}));
  }
  TESSERA_ASSIGN_OR_RETURN(const std::vector<std::string> addresses, resolve(ticket.host));
  settings.connect_timeout_ns = give_up - clock.now();
  if (settings.connect_timeout_ns <= 0)
    return absl::DeadlineExceededError(
        absl::StrCat("resolve `", ticket.host, "`: that alone took ", to_seconds(timeout_ns), " s"));
  return connect_to_first(addresses, settings, clock);
}

StatusOr<std::unique_ptr<Connection>> connect_to_first(std::span<const std::string> addresses,
                                                       ConnectionSettings settings, const Clock& clock) {
  const TimeNs give_up = clock.now() + settings.connect_timeout_ns;
  Status failure;
  for (; !addresses.empty(); addresses = addresses.subspan(1)) {
    settings.server_address = addresses.front();
    settings.connect_timeout_ns = std::max<DurationNs>(give_up - clock.now(), 0) / std::ssize(addresses);
    auto connection = Connection::connect(settings, clock);
    if (connection.ok()) return connection;
    failure = connection.status();
    if (!absl::IsUnavailable(failure)) break;  // it answered
  }
  return failure;
}

}  // namespace tessera::client
