#include "transport/asio/udp_socket.h"

#include <utility>

#include "transport/asio/endpoint.h"

namespace tessera::transport {

using asio::ip::udp;

UdpSocket::UdpSocket(asio::any_io_executor executor, const UdpSocketSettings& settings, Handler handler)
    : socket_(std::move(executor)), settings_(settings), handler_(std::move(handler)), buffer_(65536) {}

StatusOr<std::shared_ptr<UdpSocket>> UdpSocket::open(asio::any_io_executor executor,
                                                     const UdpSocketSettings& settings, Handler handler) {
  TESSERA_ASSIGN_OR_RETURN(const asio::ip::address address, parse_address(settings.address));
  std::shared_ptr<UdpSocket> self(new UdpSocket(std::move(executor), settings, std::move(handler)));
  udp::socket& socket = self->socket_;
  SystemError error;
  socket.open(address.is_v6() ? udp::v6() : udp::v4(), error);
  if (!error) socket.bind({address, settings.port}, error);
  if (error) return bind_error("UDP", address, settings.port, error);
  socket.non_blocking(true, error);
  // Smaller buffers than asked for are normal.
  SystemError ignored;
  socket.set_option(asio::socket_base::receive_buffer_size(settings.socket_buffer_bytes), ignored);
  socket.set_option(asio::socket_base::send_buffer_size(settings.socket_buffer_bytes), ignored);
  self->port_ = socket.local_endpoint(error).port();
  self->ipv6_ = address.is_v6();
  return self;
}

void UdpSocket::start() {
  const std::lock_guard lock(mutex_);
  receive();
}

void UdpSocket::receive() {
  socket_.async_wait(udp::socket::wait_read,
                     [self = shared_from_this()](SystemError e) { self->on_readable(e); });
}

void UdpSocket::on_readable(SystemError error) {
  for (int i = 0; i < kMaxBatch && !error; ++i) {
    udp::endpoint from;
    size_t bytes = 0;
    {
      const std::lock_guard lock(mutex_);
      if (!socket_.is_open()) return;
      bytes = socket_.receive_from(asio::buffer(buffer_), from, 0, error);
      if (error == asio::error::would_block) break;
      if (error) {  // e.g. an ICMP answer to what was sent: the socket lives on
        last_error_ = error.message();
        error.clear();
        continue;
      }
    }
    handler_(peer_address(from), std::span(buffer_).first(bytes));
  }
  const std::lock_guard lock(mutex_);
  if (socket_.is_open()) receive();
}

bool UdpSocket::try_send(const udp::endpoint& to, const Datagram& datagram) {
  SystemError error;
  socket_.send_to(asio::buffer(datagram), to, 0, error);
  if (error == asio::error::would_block || error == asio::error::no_buffer_space) return false;
  if (error) last_error_ = error.message();
  return true;
}

bool UdpSocket::send(const PeerAddress& to, Datagram datagram) {
  const std::lock_guard lock(mutex_);
  if (!socket_.is_open()) return false;
  const udp::endpoint endpoint = udp_endpoint(to, ipv6_);
  if (queue_.empty() && try_send(endpoint, datagram)) return true;
  if (queue_.size() >= settings_.max_queued_datagrams) {
    ++dropped_;
    return false;
  }
  queue_.push_back({endpoint, std::move(datagram)});
  wait_writable();
  return true;
}

void UdpSocket::wait_writable() {
  if (std::exchange(waiting_writable_, true)) return;
  socket_.async_wait(udp::socket::wait_write, [self = shared_from_this()](SystemError e) {
    const std::lock_guard lock(self->mutex_);
    self->waiting_writable_ = false;
    if (!e && self->socket_.is_open()) self->flush();
  });
}

void UdpSocket::flush() {
  while (!queue_.empty() && try_send(queue_.front().to, queue_.front().datagram)) queue_.pop_front();
  if (!queue_.empty()) wait_writable();
}

void UdpSocket::close() {
  const std::lock_guard lock(mutex_);
  SystemError ignored;
  socket_.close(ignored);
  queue_.clear();
}

uint64_t UdpSocket::dropped() const {
  const std::lock_guard lock(mutex_);
  return dropped_;
}

std::string UdpSocket::last_error() const {
  const std::lock_guard lock(mutex_);
  return last_error_;
}

}  // namespace tessera::transport
