// The ticket of a session that a daemon has made.
#pragma once

#include <algorithm>
#include <string>

#include "base/status.h"
#include "client-sdk/ticket.h"
#include "tessera/v1/control.pb.h"

namespace tessera::client {

// `host`: by which the client reaches the daemon. Internal: the daemon's token is none.
inline StatusOr<Ticket> ticket_of(const v1::Ticket& made, std::string host) {
  Ticket ticket{.host = std::move(host), .meta_port = static_cast<uint16_t>(made.meta_port())};
  if (made.token().size() != ticket.token.size())
    return absl::InternalError("the ticket's token has a wrong size");
  std::ranges::copy(made.token(), ticket.token.begin());
  return ticket;
}

}  // namespace tessera::client
