// The crudest HTTP client: sends bytes, reads until the server closes.
#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/write.hpp>
#include <string>
#include <string_view>

#include "transport/asio/asio.h"

namespace tessera::server::test {

// What the server answered; empty: nothing. A stream may be TLS, after its handshake.
template <class Stream>
std::string exchange(Stream& stream, std::string_view request) {
  transport::SystemError error;
  boost::asio::write(stream, boost::asio::buffer(request.data(), request.size()), error);
  std::string answer;
  boost::asio::read(stream, boost::asio::dynamic_buffer(answer), error);
  return answer;
}

inline boost::asio::ip::tcp::endpoint loopback(uint16_t port) {
  return {boost::asio::ip::make_address("127.0.0.1"), port};
}

// `last`: nothing more is sent, which the server sees as the end of what it has to read.
inline std::string ask(uint16_t port, std::string_view request, bool last = false) {
  boost::asio::io_context io;
  boost::asio::ip::tcp::socket socket(io);
  transport::SystemError error;
  socket.connect(loopback(port), error);
  if (!last) return exchange(socket, request);
  boost::asio::write(socket, boost::asio::buffer(request.data(), request.size()), error);
  socket.shutdown(socket.shutdown_send, error);
  return exchange(socket, "");
}

inline std::string get(uint16_t port, const std::string& path) {
  return ask(port, "GET " + path + " HTTP/1.1\r\nHost: test\r\n\r\n");
}

inline std::string body_of(const std::string& answer) {
  const size_t end = answer.find("\r\n\r\n");
  return end == std::string::npos ? "" : answer.substr(end + 4);
}

}  // namespace tessera::server::test
