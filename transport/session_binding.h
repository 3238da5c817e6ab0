// One media port for all sessions: which session a datagram belongs to. A client shows its token once; from
// then on its address stands for it. Sans-IO; safe for untrusted input.
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <utility>

#include "base/status.h"
#include "base/time.h"
#include "transport/datagram.h"
#include "transport/session_token.h"

namespace tessera::transport {

// IPv4 addresses are mapped into IPv6 (::ffff:a.b.c.d).
struct PeerAddress {
  std::array<uint8_t, 16> ip{};
  uint16_t port = 0;
  auto operator<=>(const PeerAddress&) const = default;
};

using SessionId = uint64_t;

struct BindingStats {
  uint64_t bound = 0, rebound = 0;  // hellos that gave a session its first, or another address
  uint64_t bad_token = 0, unknown_address = 0, malformed = 0;  // dropped
};

// A decision about one datagram.
struct RoutedDatagram {
  std::optional<SessionId> session;           // empty: it was dropped
  DatagramKind kind = DatagramKind::unknown;  // rtp, rtcp, pose or hello
  Datagram answer;                            // to send back to where it came from; may be empty
  bool address_changed = false;               // the session's address is new
};

// Not thread-safe.
class SessionBinding {
 public:
  // AlreadyExists: the id or the token is in use.
  Status add(SessionId session, const SessionToken& token);
  void remove(SessionId session);

  RoutedDatagram route(const PeerAddress& from, std::span<const uint8_t> datagram);
  // Where the session's client is. Empty before its hello.
  std::optional<PeerAddress> address_of(SessionId session) const;
  const BindingStats& stats() const { return stats_; }
  size_t sessions() const { return sessions_.size(); }

 private:
  struct Entry {
    SessionToken token;
    std::optional<PeerAddress> address;
  };
  std::optional<SessionId> find_token(const SessionToken& token) const;
  RoutedDatagram on_hello(const PeerAddress& from, std::span<const uint8_t> datagram);
  bool bind(SessionId session, const PeerAddress& address);

  std::map<SessionId, Entry> sessions_;
  std::map<PeerAddress, SessionId> by_address_;
  BindingStats stats_;
};

// Lets the first line of a kind through and then one per interval, so that hostile traffic cannot fill a log.
class LogLimiter {
 public:
  explicit LogLimiter(DurationNs interval_ns = 10 * kNsPerSecond) : interval_ns_(interval_ns) {}
  // The number of events since the last line, this one included, if a line is due now.
  std::optional<uint64_t> event(TimeNs now) {
    ++events_;
    if (last_ns_ && now - *last_ns_ < interval_ns_) return std::nullopt;
    last_ns_ = now;
    return std::exchange(events_, 0);
  }

 private:
  DurationNs interval_ns_;
  std::optional<TimeNs> last_ns_;
  uint64_t events_ = 0;
};

}  // namespace tessera::transport
