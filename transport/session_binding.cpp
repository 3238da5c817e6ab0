#include "transport/session_binding.h"

namespace tessera::transport {

Status SessionBinding::add(SessionId session, const SessionToken& token) {
  if (sessions_.contains(session))
    return absl::AlreadyExistsError(absl::StrCat("session ", session, " exists"));
  if (find_token(token)) return absl::AlreadyExistsError("the token is another session's");
  sessions_[session] = {token, std::nullopt};
  return absl::OkStatus();
}

void SessionBinding::remove(SessionId session) {
  const auto found = sessions_.find(session);
  if (found == sessions_.end()) return;
  if (found->second.address) by_address_.erase(*found->second.address);
  sessions_.erase(found);
}

// Looks at every session, whatever it finds, so that time tells nothing.
std::optional<SessionId> SessionBinding::find_token(const SessionToken& token) const {
  std::optional<SessionId> found;
  for (const auto& [session, entry] : sessions_) {
    if (equal_in_constant_time(entry.token, token)) found = session;
  }
  return found;
}

std::optional<PeerAddress> SessionBinding::address_of(SessionId session) const {
  const auto found = sessions_.find(session);
  return found == sessions_.end() ? std::nullopt : found->second.address;
}

// One address a session and one session an address. True if the session's address changed.
bool SessionBinding::bind(SessionId session, const PeerAddress& address) {
  Entry& entry = sessions_.at(session);
  if (entry.address == address) return false;
  if (const auto other = by_address_.find(address); other != by_address_.end())
    sessions_.at(other->second).address.reset();
  if (entry.address) by_address_.erase(*entry.address);
  ++(entry.address ? stats_.rebound : stats_.bound);
  entry.address = address;
  by_address_[address] = session;
  return true;
}

RoutedDatagram SessionBinding::on_hello(const PeerAddress& from, std::span<const uint8_t> datagram) {
  const StatusOr<HelloDatagram> hello = parse_hello(datagram);
  if (!hello.ok()) {
    ++stats_.malformed;
    return {};
  }
  const std::optional<SessionId> session = find_token(hello->token);
  if (!session) {
    ++stats_.bad_token;
    return {};
  }
  const bool supported = hello->version == kDatagramVersion;
  const HelloStatus status = supported ? HelloStatus::bound : HelloStatus::unsupported_version;
  RoutedDatagram routed{.kind = DatagramKind::hello,
                        .answer = write_hello_answer({kDatagramVersion, status, hello->nonce})};
  if (!supported) return routed;
  routed.session = session;
  routed.address_changed = bind(*session, from);
  return routed;
}

RoutedDatagram SessionBinding::route(const PeerAddress& from, std::span<const uint8_t> datagram) {
  const DatagramKind kind = classify(datagram);
  if (kind == DatagramKind::hello) return on_hello(from, datagram);
  if (kind == DatagramKind::unknown || kind == DatagramKind::hello_answer) {
    ++stats_.malformed;
    return {};
  }
  const auto found = by_address_.find(from);
  if (found == by_address_.end()) {
    ++stats_.unknown_address;
    return {};
  }
  return {.session = found->second, .kind = kind};
}

}  // namespace tessera::transport
