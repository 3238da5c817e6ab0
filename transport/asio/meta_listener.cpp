#include "transport/asio/meta_listener.h"

#include <netinet/tcp.h>
#include <sys/socket.h>

#include <chrono>
#include <utility>

#include "base/log.h"
#include "transport/asio/endpoint.h"

namespace tessera::transport {
namespace {

constexpr size_t kMaxHelloPayload = 256;
// That the system holds before the peer's window takes them. It would hold megabytes, and a peer that stopped
// reading a minute ago would seem to take them all.
constexpr int kMaxUnsentBytes = 64 << 10;
constexpr auto kAcceptRetry = std::chrono::seconds(1);  // e.g. out of file descriptors

void tune(asio::ip::tcp::socket& socket) {
  SystemError ignored;
  socket.set_option(asio::ip::tcp::no_delay(true), ignored);
  (void)setsockopt(socket.native_handle(), IPPROTO_TCP, TCP_NOTSENT_LOWAT, &kMaxUnsentBytes,
                   sizeof kMaxUnsentBytes);
}

}  // namespace

// A connection from its first byte to its hello; afterwards the events of its admission.
struct MetaListener::Waiting {
  std::string peer;
  asio::steady_timer timer;
  std::shared_ptr<MetaConnection> connection;
  ByteStream* stream = nullptr;  // before there is a connection
  MetaConnectionEvents events;
  bool admitted = false;
};

MetaListener::MetaListener(asio::any_io_executor executor, const MetaListenerSettings& settings, Admit admit)
    : executor_(executor),
      settings_(settings),
      admit_(std::move(admit)),
      acceptor_(asio::make_strand(executor)),
      retry_timer_(acceptor_.get_executor()) {}

StatusOr<std::shared_ptr<MetaListener>> MetaListener::open(asio::any_io_executor executor,
                                                           const MetaListenerSettings& settings,
                                                           Admit admit) {
  TESSERA_ASSIGN_OR_RETURN(const asio::ip::address address, parse_address(settings.address));
  std::shared_ptr<MetaListener> self(new MetaListener(std::move(executor), settings, std::move(admit)));
  const asio::ip::tcp::endpoint endpoint(address, settings.port);
  SystemError error;
  self->acceptor_.open(endpoint.protocol(), error);
  if (!error) self->acceptor_.set_option(asio::socket_base::reuse_address(true), error);
  if (!error) self->acceptor_.bind(endpoint, error);
  if (!error) self->acceptor_.listen(asio::socket_base::max_listen_connections, error);
  if (error) return bind_error("TCP", address, settings.port, error);
  self->port_ = self->acceptor_.local_endpoint(error).port();
  const std::lock_guard lock(self->mutex_);
  self->accept();
  return self;
}

void MetaListener::close() {
  const std::lock_guard lock(mutex_);
  SystemError ignored;
  acceptor_.close(ignored);
  retry_timer_.cancel();
  for (const auto& waiting : waiting_)
    asio::post(waiting->timer.get_executor(), [waiting] { waiting->timer.cancel(); });
}

void MetaListener::accept() {
  acceptor_.async_accept(asio::make_strand(executor_),
                         [self = shared_from_this()](SystemError e, asio::ip::tcp::socket s) {
                           self->on_accepted(e, std::move(s));
                         });
}

// Whoever comes in masses is not waited for: what the system does not take at once is not said.
void MetaListener::refuse(asio::ip::tcp::socket socket) {
  if (const auto count = refusal_log_.event(SteadyClock().now()))
    log_event(spdlog::level::warn, "connections refused",
              {{"port", port_}, {"count", *count}, {"others_without_hello", waiting_.size()}});
  if (settings_.tls) return;  // nothing can be said before the handshake
  std::vector<uint8_t> frame;
  (void)write_frame(
      FrameType::error,
      encode(ErrorMessage{ErrorCode::full, "too many connections wait for their hello; try again"}),
      frame);  // short enough
  SystemError ignored;
  socket.non_blocking(true, ignored);
  socket.write_some(asio::buffer(frame), ignored);
}

void MetaListener::on_accepted(SystemError error, asio::ip::tcp::socket socket) {
  const std::lock_guard lock(mutex_);
  if (!acceptor_.is_open()) return;
  if (error) {
    spdlog::warn("meta port {}: cannot accept a connection: {}", port_, error.message());
    retry_timer_.expires_after(kAcceptRetry);
    retry_timer_.async_wait([self = shared_from_this()](SystemError e) {
      const std::lock_guard relock(self->mutex_);
      if (!e && self->acceptor_.is_open()) self->accept();
    });
    return;
  }
  accept();
  if (waiting_.size() >= settings_.max_waiting) return refuse(std::move(socket));
  tune(socket);
  SystemError ignored;
  const auto remote = socket.remote_endpoint(ignored);
  const asio::any_io_executor strand = socket.get_executor();
  std::unique_ptr<ByteStream> stream =
      settings_.tls ? settings_.tls->make_stream(std::move(socket)) : make_plain_stream(std::move(socket));
  const std::shared_ptr<Waiting> waiting(
      new Waiting{to_string(remote.address(), remote.port()), asio::steady_timer(strand)});
  waiting_.insert(waiting);
  asio::post(strand, [self = shared_from_this(), waiting,
                      s = std::make_shared<std::unique_ptr<ByteStream>>(std::move(stream))] {
    self->begin_hello(std::move(*s), waiting);
  });
}

// On the connection's strand from here on.
void MetaListener::begin_hello(std::unique_ptr<ByteStream> stream, std::shared_ptr<Waiting> waiting) {
  waiting->stream = stream.get();
  waiting->timer.expires_after(std::chrono::nanoseconds(settings_.hello_timeout_ns));
  waiting->timer.async_wait([self = shared_from_this(), waiting](SystemError) {
    if (waiting->admitted) return;
    if (waiting->connection)
      waiting->connection->close(absl::DeadlineExceededError("no hello within the time for it"));
    if (waiting->stream) waiting->stream->close();
  });
  const auto shared = std::make_shared<std::unique_ptr<ByteStream>>(std::move(stream));
  (*shared)->async_handshake([self = shared_from_this(), waiting, shared](SystemError error) {
    waiting->stream = nullptr;
    if (error) {
      spdlog::debug("meta port: TLS handshake with {} failed: {}", waiting->peer, error.message());
      return self->forget(waiting);
    }
    MetaConnectionSettings settings = self->settings_.connection;
    settings.max_payload = kMaxHelloPayload;
    MetaConnectionEvents events;
    events.on_frame = [self, waiting](FrameType type, std::span<const uint8_t> payload) {
      return self->on_hello(waiting, type, payload);
    };
    events.on_closed = [self, waiting](const Status& reason) {
      self->forget(waiting);
      if (waiting->admitted && waiting->events.on_closed) waiting->events.on_closed(reason);
      waiting->events = {};
      waiting->connection.reset();
    };
    waiting->connection = MetaConnection::start(std::move(*shared), settings, std::move(events));
  });
}

Status MetaListener::on_hello(const std::shared_ptr<Waiting>& waiting, FrameType type,
                              std::span<const uint8_t> payload) {
  if (waiting->admitted)
    return waiting->events.on_frame ? waiting->events.on_frame(type, payload) : absl::OkStatus();
  if (type != FrameType::hello) return absl::InvalidArgumentError("the first frame must be a hello");
  TESSERA_ASSIGN_OR_RETURN(const Hello hello, decode_hello(payload));
  TESSERA_ASSIGN_OR_RETURN(Admission admission, admit_(hello, waiting->peer));
  waiting->admitted = true;
  waiting->events = std::move(admission.events);
  waiting->connection->set_max_payload(settings_.max_client_payload);
  forget(waiting);
  TESSERA_RETURN_IF_ERROR(waiting->connection->send(FrameType::welcome, encode(admission.welcome)));
  if (admission.on_connected) admission.on_connected(waiting->connection);
  return absl::OkStatus();
}

void MetaListener::forget(const std::shared_ptr<Waiting>& waiting) {
  waiting->timer.cancel();
  const std::lock_guard lock(mutex_);
  waiting_.erase(waiting);
}

}  // namespace tessera::transport
