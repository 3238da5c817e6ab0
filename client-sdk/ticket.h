// How a session reaches the app that is to watch it: one line of text, e.g. from a launcher or a QR code.
//
//   tessera://HOST:PORT/TOKEN            TOKEN: 32 hexadecimal digits
//   tessera://HOST:PORT/TOKEN?ca=FILE    TLS; FILE: the authority's certificate (PEM); empty: the system's
//
// HOST is a name, an IPv4 address, or an IPv6 address in brackets; over TLS it is also what the server's
// certificate must name. In FILE, %XX stands for a byte. Whoever has a ticket can watch the session: keep it
// secret.
#pragma once

#include <absl/strings/string_view.h>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "base/status.h"
#include "base/time.h"
#include "client-sdk/connection.h"
#include "transport/session_token.h"

namespace tessera::client {

struct Ticket {
  std::string host;        // without brackets
  uint16_t meta_port = 0;  // TCP
  transport::SessionToken token{};
  std::optional<std::string> authority_file;  // of TLS; none: clear text

  bool operator==(const Ticket&) const = default;
};

// InvalidArgument says which part is wrong, and never shows the token. to_string() is its inverse.
StatusOr<Ticket> parse_ticket(absl::string_view text);
std::string to_string(const Ticket& ticket);

// Connection::connect() to the first of the host's addresses that answers; blocks. The error names the step
// (certificate, resolve, or as there). `timeout_ns` is for everything
// together, but the system's resolver takes the time that it takes.
StatusOr<std::unique_ptr<Connection>> connect(const Ticket& ticket, const transport::ClientSettings& client,
                                              DurationNs timeout_ns, const Clock& clock);
// To the first of these, one at least; connect_timeout_ns is for all together, shared out evenly: one that a
// firewall swallows leaves time for the rest.
StatusOr<std::unique_ptr<Connection>> connect_to_first(std::span<const std::string> addresses,
                                                       ConnectionSettings settings, const Clock& clock);

}  // namespace tessera::client
