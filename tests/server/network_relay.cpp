#include "network_relay.h"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/write.hpp>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "transport/asio/asio.h"

namespace tessera::server::test {
namespace {

namespace asio = transport::asio;
using asio::ip::tcp;
using asio::ip::udp;
using transport::SystemError;
using transport::test::EmulatedLink;

constexpr int kHeldBytes = 16 << 10;  // that TCP takes while it is held
const auto kServer = asio::ip::address_v4::loopback();

// One direction of datagrams.
class DatagramPath {
 public:
  DatagramPath(udp::socket& to, const transport::test::EmulatedLinkSettings& settings, const Clock& clock)
      : to_(to), clock_(clock), timer_(to.get_executor()), link_(settings) {}

  void send(std::vector<uint8_t> datagram) {
    const uint64_t lost = link_.lost();
    link_.send(clock_.now(), std::move(datagram));
    lost_ += link_.lost() - lost;
    deliver();
  }
  void set_target(const udp::endpoint& target) { target_ = target; }
  uint64_t lost() const { return lost_; }

 private:
  void deliver() {
    SystemError ignored;
    for (const auto& datagram : link_.poll(clock_.now()))
      if (target_) to_.send_to(asio::buffer(datagram), *target_, 0, ignored);
    const auto next = link_.next_event_ns();
    if (!next) return;
    timer_.expires_after(std::chrono::nanoseconds(std::max<DurationNs>(0, *next - clock_.now())));
    timer_.async_wait([this](SystemError error) {
      if (!error) deliver();
    });
  }

  udp::socket& to_;
  const Clock& clock_;
  asio::steady_timer timer_;
  EmulatedLink link_;
  std::optional<udp::endpoint> target_;
  std::atomic<uint64_t> lost_ = 0;
};

// One direction of a TCP connection.
struct Pipe : std::enable_shared_from_this<Pipe> {
  Pipe(std::shared_ptr<tcp::socket> f, std::shared_ptr<tcp::socket> t)
      : from(std::move(f)), to(std::move(t)) {}

  void read() {
    waiting = held;
    if (held) return;
    from->async_read_some(asio::buffer(buffer), [self = shared_from_this()](SystemError error, size_t bytes) {
      if (error) return self->end();
      asio::async_write(*self->to, asio::buffer(self->buffer, bytes),
                        [self](SystemError failed, size_t) { failed ? self->end() : self->read(); });
    });
  }
  void hold(bool hold_now) {
    held = hold_now;
    if (!held && std::exchange(waiting, false)) read();
  }
  void end() {
    SystemError ignored;
    to->shutdown(tcp::socket::shutdown_both, ignored);
    from->shutdown(tcp::socket::shutdown_both, ignored);
  }

  std::shared_ptr<tcp::socket> from, to;
  std::array<char, 4096> buffer{};
  bool held = false, waiting = false;
};

}  // namespace

struct NetworkRelay::Impl {
  Impl(const SessionTicket& t, const NetworkSettings& settings, const Clock& clock)
      : ticket(t),
        client_side(io),
        server_side(io, udp::endpoint(kServer, 0)),
        acceptor(io),
        up(server_side, settings.up, clock),
        down(client_side, settings.down, clock) {
    up.set_target({kServer, ticket.media_port});
  }

  // 127.0.0.2 and up: the same media port may be taken on some of them.
  bool listen() {
    for (uint8_t host = 2; host < 255; ++host) {
      const auto candidate = asio::ip::address_v4({127, 0, 0, host});
      SystemError error;
      client_side.open(udp::v4(), error);
      client_side.bind({candidate, ticket.media_port}, error);
      if (!error) {
        address = candidate.to_string();
        acceptor = tcp::acceptor(io, {candidate, 0});
        meta_port = acceptor.local_endpoint().port();
        return true;
      }
      client_side.close(error);
    }
    return false;
  }

  void accept() {
    acceptor.async_accept([this](SystemError error, tcp::socket socket) {
      if (error) return;
      auto client = std::make_shared<tcp::socket>(std::move(socket));
      auto server = std::make_shared<tcp::socket>(io, tcp::v4());
      SystemError ignored;
      // Before it connects, so that the window starts as small.
      server->set_option(asio::socket_base::receive_buffer_size(kHeldBytes), ignored);
      server->connect({kServer, ticket.meta_port}, ignored);
      const auto to_server = std::make_shared<Pipe>(client, server);
      to_client = std::make_shared<Pipe>(server, client);
      to_server->read();
      to_client->read();
      accept();
    });
  }

  void receive(udp::socket& socket, DatagramPath& path) {
    socket.async_wait(udp::socket::wait_read, [this, &socket, &path](SystemError error) {
      if (error) return;
      std::vector<uint8_t> datagram(65536);
      udp::endpoint from;
      const size_t bytes = socket.receive_from(asio::buffer(datagram), from, 0, error);
      if (!error) {
        datagram.resize(bytes);
        if (&path == &up) down.set_target(from);
        path.send(std::move(datagram));
      }
      receive(socket, path);
    });
  }

  const SessionTicket ticket;
  asio::io_context io{1};
  udp::socket client_side, server_side;
  tcp::acceptor acceptor;
  DatagramPath up, down;
  std::shared_ptr<Pipe> to_client;
  std::string address;
  uint16_t meta_port = 0;
  std::thread thread;
};

NetworkRelay::NetworkRelay(const SessionTicket& ticket, const NetworkSettings& settings, const Clock& clock)
    : impl_(std::make_unique<Impl>(ticket, settings, clock)) {
  if (!impl_->listen()) ADD_FAILURE() << "no loopback address has UDP port " << ticket.media_port << " free";
  impl_->accept();
  impl_->receive(impl_->client_side, impl_->up);
  impl_->receive(impl_->server_side, impl_->down);
  impl_->thread = std::thread([this] { impl_->io.run(); });
}

NetworkRelay::~NetworkRelay() {
  impl_->io.stop();
  impl_->thread.join();
}

const std::string& NetworkRelay::address() const {
  return impl_->address;
}
uint16_t NetworkRelay::meta_port() const {
  return impl_->meta_port;
}

void NetworkRelay::hold_meta(bool held) {
  asio::post(impl_->io, [this, held] {
    if (impl_->to_client) impl_->to_client->hold(held);
  });
}

uint64_t NetworkRelay::lost() const {
  return impl_->up.lost() + impl_->down.lost();
}

}  // namespace tessera::server::test
