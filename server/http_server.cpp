#include "server/http_server.h"

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/beast/http.hpp>
#include <limits>
#include <set>
#include <sstream>
#include <thread>
#include <utility>
#include <vector>

#include "base/log.h"
#include "transport/asio/endpoint.h"

namespace tessera::server {
namespace {

namespace asio = transport::asio;
namespace http = boost::beast::http;
using asio::ip::tcp;
using transport::ByteStream;
using transport::SystemError;

constexpr auto kAcceptRetry = std::chrono::seconds(1);  // e.g. out of file descriptors

// One request and its answer. All runs on the server's thread; lives in its handlers.
class Exchange : public std::enable_shared_from_this<Exchange> {
 public:
  Exchange(std::unique_ptr<ByteStream> stream, const HttpServerSettings& settings,
           const HttpServer::Handler& handler, std::function<void(Exchange*)> done)
      : stream_(std::move(stream)),
        handler_(handler),
        done_(std::move(done)),
        timer_(stream_->executor()),
        in_(settings.max_header_bytes + 1) {
    parser_.header_limit(settings.max_header_bytes);
    parser_.body_limit(std::numeric_limits<uint64_t>::max());  // no body is read
    timer_.expires_after(std::chrono::nanoseconds(settings.timeout_ns));
  }
  ~Exchange() { done_(this); }

  void start() {
    timer_.async_wait([weak = weak_from_this()](SystemError error) {
      if (const auto self = weak.lock(); self && !error) self->close();
    });
    stream_->async_handshake(
        [self = shared_from_this()](SystemError error) { error ? self->close() : self->read(); });
  }
  void close() {
    timer_.cancel();
    stream_->close();
  }

 private:
  void read() {
    stream_->async_read_some(asio::buffer(in_.data() + filled_, in_.size() - filled_),
                             [self = shared_from_this()](SystemError error, size_t bytes) {
                               error ? self->close() : self->on_read(bytes);
                             });
  }

  void on_read(size_t bytes) {
    filled_ += bytes;
    SystemError error;
    const size_t used = parser_.put(asio::buffer(in_.data(), filled_), error);
    std::copy(in_.begin() + static_cast<ptrdiff_t>(used), in_.begin() + static_cast<ptrdiff_t>(filled_),
              in_.begin());
    filled_ -= used;
    if (error == http::error::header_limit || filled_ == in_.size())
      return answer({.status = 431, .body = "the request's header is too long\n"});
    if (error && error != http::error::need_more && !parser_.is_header_done())
      return answer({.status = 400, .body = "this is no HTTP request\n"});
    if (!parser_.is_header_done()) return read();
    answer(respond());
  }

  HttpResponse respond() {
    const auto& request = parser_.get();
    if (request.method() != http::verb::get && request.method() != http::verb::head)
      return {.status = 405, .body = "only GET and HEAD\n"};
    const std::string_view target(request.target().data(), request.target().size());
    return handler_(target.substr(0, target.find('?')));
  }

  void answer(HttpResponse response) {
    http::response<http::string_body> message(static_cast<http::status>(response.status), 11);
    message.set(http::field::content_type, response.content_type);
    message.set(http::field::cache_control, "no-store");
    message.set("X-Content-Type-Options", "nosniff");
    if (response.status == 405) message.set(http::field::allow, "GET, HEAD");
    message.keep_alive(false);
    message.content_length(response.body.size());
    if (parser_.get().method() != http::verb::head) message.body() = std::move(response.body);
    std::ostringstream out;
    out << message;
    out_ = out.str();
    write(0);
  }

  void write(size_t written) {
    if (written == out_.size()) return filled_ == 0 && parser_.is_header_done() ? close() : linger();
    stream_->async_write_some(asio::buffer(out_.data() + written, out_.size() - written),
                              [self = shared_from_this(), written](SystemError error, size_t bytes) {
                                error ? self->close() : self->write(written + bytes);
                              });
  }

  // What a peer still sends that has its answer is thrown away, up to the time limit: closing at once would
  // reset the connection and could take the answer with it.
  void linger() {
    stream_->async_read_some(asio::buffer(in_), [self = shared_from_this()](SystemError error, size_t) {
      error ? self->close() : self->linger();
    });
  }

  std::unique_ptr<ByteStream> stream_;
  const HttpServer::Handler& handler_;
  std::function<void(Exchange*)> done_;
  asio::steady_timer timer_;
  http::request_parser<http::empty_body> parser_;
  std::vector<char> in_;  // a whole header, as the parser wants it
  size_t filled_ = 0;
  std::string out_;
};

}  // namespace

struct HttpServer::Impl {
  Impl(const HttpServerSettings& s, Handler h) : settings(s), handler(std::move(h)) {}

  Status open();
  void accept();
  void on_accepted(SystemError error, tcp::socket socket);
  void close();

  const HttpServerSettings settings;
  const Handler handler;
  asio::io_context io{1};
  tcp::acceptor acceptor{io};
  asio::steady_timer retry_timer{io};
  std::set<Exchange*> under_way;
  uint16_t port = 0;
  std::thread thread;
};

Status HttpServer::Impl::open() {
  TESSERA_ASSIGN_OR_RETURN(const asio::ip::address address, transport::parse_address(settings.address));
  const tcp::endpoint endpoint(address, settings.port);
  SystemError error;
  acceptor.open(endpoint.protocol(), error);
  if (!error) acceptor.set_option(asio::socket_base::reuse_address(true), error);
  if (!error) acceptor.bind(endpoint, error);
  if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
  if (error) return transport::bind_error("HTTP", address, settings.port, error);
  port = acceptor.local_endpoint(error).port();
  accept();
  thread = std::thread([this] { io.run(); });
  return absl::OkStatus();
}

void HttpServer::Impl::accept() {
  acceptor.async_accept(
      [this](SystemError error, tcp::socket socket) { on_accepted(error, std::move(socket)); });
}

void HttpServer::Impl::on_accepted(SystemError error, tcp::socket socket) {
  if (!acceptor.is_open()) return;
  if (error) {
    log_event(spdlog::level::warn, "http cannot accept", {{"port", port}, {"error", error.message()}});
    retry_timer.expires_after(kAcceptRetry);
    retry_timer.async_wait([this](SystemError e) {
      if (!e) accept();
    });
    return;
  }
  accept();
  if (under_way.size() >= settings.max_connections) return;  // closes it
  auto stream = settings.tls ? settings.tls->make_stream(std::move(socket))
                             : transport::make_plain_stream(std::move(socket));
  const auto exchange = std::make_shared<Exchange>(std::move(stream), settings, handler,
                                                   [this](Exchange* ended) { under_way.erase(ended); });
  under_way.insert(exchange.get());
  exchange->start();
}

void HttpServer::Impl::close() {
  SystemError ignored;
  acceptor.close(ignored);
  retry_timer.cancel();
  for (Exchange* exchange : under_way) exchange->close();
}

HttpServer::HttpServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

StatusOr<std::unique_ptr<HttpServer>> HttpServer::open(const HttpServerSettings& settings, Handler handler) {
  std::unique_ptr<HttpServer> server(new HttpServer(std::make_unique<Impl>(settings, std::move(handler))));
  TESSERA_RETURN_IF_ERROR(server->impl_->open());
  return server;
}

HttpServer::~HttpServer() {
  if (!impl_->thread.joinable()) return;
  asio::post(impl_->io, [this] { impl_->close(); });
  impl_->thread.join();  // closed sockets end all handlers
}

uint16_t HttpServer::port() const {
  return impl_->port;
}

}  // namespace tessera::server
