#include "transport/asio/endpoint.h"

#include <algorithm>
#include <boost/asio/io_context.hpp>

namespace tessera::transport {

StatusOr<asio::ip::address> parse_address(const std::string& text) {
  SystemError error;
  const asio::ip::address address = asio::ip::make_address(text, error);
  if (error) return absl::InvalidArgumentError(absl::StrCat("`", text, "` is not an IPv4 or IPv6 address"));
  return address;
}

PeerAddress peer_address(const asio::ip::udp::endpoint& endpoint) {
  const asio::ip::address address = endpoint.address();
  const auto v6 =
      address.is_v6() ? address.to_v6() : asio::ip::make_address_v6(asio::ip::v4_mapped, address.to_v4());
  PeerAddress out{.port = endpoint.port()};
  std::ranges::copy(v6.to_bytes(), out.ip.begin());
  return out;
}

asio::ip::udp::endpoint udp_endpoint(const PeerAddress& address, bool ipv6_socket) {
  asio::ip::address_v6::bytes_type bytes;
  std::ranges::copy(address.ip, bytes.begin());
  const asio::ip::address_v6 v6(bytes);
  if (!ipv6_socket && v6.is_v4_mapped())
    return {asio::ip::make_address_v4(asio::ip::v4_mapped, v6), address.port};
  return {v6, address.port};
}

std::string to_string(const PeerAddress& address) {
  return udp_endpoint(address, false).address().to_string();
}

std::string to_string(const asio::ip::address& address, uint16_t port) {
  return address.is_v6() ? absl::StrCat("[", address.to_string(), "]:", port)
                         : absl::StrCat(address.to_string(), ":", port);
}

Status check_tcp_port(const char* protocol, const asio::ip::address& address, uint16_t port) {
  asio::io_context io;
  asio::ip::tcp::acceptor acceptor(io);
  const asio::ip::tcp::endpoint endpoint(address, port);
  SystemError error;
  acceptor.open(endpoint.protocol(), error);
  if (!error) acceptor.set_option(asio::socket_base::reuse_address(true), error);
  if (!error) acceptor.bind(endpoint, error);
  if (!error) acceptor.listen(1, error);
  return error ? bind_error(protocol, address, port, error) : absl::OkStatus();
}

Status check_udp_port(const asio::ip::address& address, uint16_t port) {
  asio::io_context io;
  asio::ip::udp::socket socket(io);
  const asio::ip::udp::endpoint endpoint(address, port);
  SystemError error;
  socket.open(endpoint.protocol(), error);
  if (!error) socket.bind(endpoint, error);
  return error ? bind_error("UDP", address, port, error) : absl::OkStatus();
}

Status bind_error(const char* protocol, const asio::ip::address& address, uint16_t port, SystemError error) {
  const std::string what =
      absl::StrCat("cannot open ", protocol, " ", to_string(address, port), ": ", error.message());
  if (error == boost::system::errc::address_in_use)
    return absl::AlreadyExistsError(
        absl::StrCat(what, ": stop the other program or choose another port (0 takes a free one)"));
  if (error == boost::system::errc::permission_denied)
    return absl::PermissionDeniedError(
        absl::StrCat(what, ": ports below 1024 need privileges; choose a higher one"));
  if (error == boost::system::errc::address_not_available)
    return absl::InvalidArgumentError(
        absl::StrCat(what, ": this machine has no such address; `ip address` lists them"));
  return absl::UnavailableError(what);
}

}  // namespace tessera::transport
