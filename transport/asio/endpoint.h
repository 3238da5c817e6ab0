// Between text, Asio's endpoints and the core's addresses; and errors that say what, where, and what to do.
#pragma once

#include <string>

#include "base/status.h"
#include "transport/asio/asio.h"
#include "transport/session_binding.h"

namespace tessera::transport {

// InvalidArgument: not an IPv4 or IPv6 address in numbers.
StatusOr<asio::ip::address> parse_address(const std::string& text);

PeerAddress peer_address(const asio::ip::udp::endpoint& endpoint);
// The endpoint of an address for a socket of this family.
asio::ip::udp::endpoint udp_endpoint(const PeerAddress& address, bool ipv6_socket);

// In numbers; IPv4 where it is mapped into IPv6.
std::string to_string(const PeerAddress& address);
// "127.0.0.1:5004" or "[::1]:5004".
std::string to_string(const asio::ip::address& address, uint16_t port);

// OK if the port can be opened now; else bind_error(). Port 0 is always free.
Status check_tcp_port(const char* protocol, const asio::ip::address& address, uint16_t port);
Status check_udp_port(const asio::ip::address& address, uint16_t port);

// Of a failed open or bind, e.g. "cannot open UDP 127.0.0.1:5004: Address already in use: stop the other
// program or choose another port (0 takes a free one)".
Status bind_error(const char* protocol, const asio::ip::address& address, uint16_t port, SystemError error);

}  // namespace tessera::transport
