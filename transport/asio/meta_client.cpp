#include "transport/asio/meta_client.h"

#include <chrono>
#include <utility>

#include "transport/asio/endpoint.h"

namespace tessera::transport {
namespace {

using asio::ip::tcp;

// One attempt; lives in its handlers. Everything runs on the socket's strand.
class Attempt : public std::enable_shared_from_this<Attempt> {
 public:
  Attempt(asio::any_io_executor strand, const MetaClientSettings& settings, MetaConnectionEvents events,
          OnWelcome done)
      : settings_(settings),
        events_(std::move(events)),
        done_(std::move(done)),
        timer_(strand),
        socket_(strand) {}

  void start() {
    const auto address = parse_address(settings_.server_address);
    if (!address.ok()) return fail(address.status());
    timer_.expires_after(std::chrono::nanoseconds(settings_.connect_timeout_ns));
    timer_.async_wait([self = shared_from_this()](SystemError error) {
      if (!error) self->on_timeout();
    });
    step_ = "connect";
    socket_.async_connect({*address, settings_.server_port}, [self = shared_from_this()](SystemError error) {
      error ? self->fail_step(error.message()) : self->shake_hands();
    });
  }

 private:
  std::string where() const {
    return absl::StrCat("TCP ", settings_.server_address, ":", settings_.server_port);
  }

  // What the failure of a step mostly comes from.
  std::string advice() const {
    if (step_ == "connect")
      return "; does tesserad run there, is this its meta port, does a firewall block it?";
    if (step_ == "TLS handshake")
      return "; does the server speak TLS, with a certificate of this name and of an authority that is "
             "trusted?";
    return absl::StrCat("; is this the meta port of a tesserad",
                        settings_.tls ? "?" : ", and does it want TLS?");
  }

  void shake_hands() {
    if (!done_) return;
    step_ = settings_.tls ? "TLS handshake" : "handshake";
    SystemError ignored;
    socket_.set_option(tcp::no_delay(true), ignored);
    stream_ = settings_.tls ? settings_.tls->make_stream(std::move(socket_))
                            : make_plain_stream(std::move(socket_));
    stream_->async_handshake([self = shared_from_this()](SystemError error) {
      error ? self->fail_step(error.message()) : self->say_hello();
    });
  }

  void say_hello() {
    if (!done_) return;
    step_ = "hello";
    MetaConnectionEvents events;
    events.on_frame = [self = shared_from_this()](FrameType type, std::span<const uint8_t> payload) {
      return self->on_frame(type, payload);
    };
    events.on_closed = [self = shared_from_this()](const Status& reason) { self->on_closed(reason); };
    connection_ = MetaConnection::start(std::move(stream_), settings_.connection, std::move(events));
    (void)connection_->send(FrameType::hello, encode(settings_.hello));  // the queue is empty
  }

  Status on_frame(FrameType type, std::span<const uint8_t> payload) {
    if (welcomed_) return events_.on_frame ? events_.on_frame(type, payload) : absl::OkStatus();
    if (type != FrameType::welcome) return absl::InvalidArgumentError("the first frame must be a welcome");
    TESSERA_ASSIGN_OR_RETURN(const Welcome welcome, decode_welcome(payload));
    if (!done_) return absl::CancelledError("too late");
    welcomed_ = true;
    timer_.cancel();
    std::exchange(done_, nullptr)(connection_, welcome);
    return absl::OkStatus();
  }

  void on_closed(const Status& reason) {
    connection_.reset();
    if (!welcomed_) {
      if (reason.ok()) return fail(absl::UnavailableError(absl::StrCat(where(), ": the server said bye")));
      // Else the server itself says why.
      const bool none_of_ours = absl::IsUnavailable(reason) || absl::IsInvalidArgument(reason);
      return fail(Status(reason.code(), absl::StrCat(where(), ": ", step_, ": ", reason.message(),
                                                     none_of_ours ? advice() : "")));
    }
    if (events_.on_closed) events_.on_closed(reason);
    events_ = {};
  }

  void on_timeout() {
    SystemError ignored;
    socket_.close(ignored);
    if (stream_) stream_->close();
    if (connection_) connection_->close(absl::DeadlineExceededError("no welcome within the time for it"));
    // Nobody there, as when the system itself gives up on a connect.
    const auto code =
        step_ == "connect" ? absl::StatusCode::kUnavailable : absl::StatusCode::kDeadlineExceeded;
    fail(Status(code, absl::StrCat(where(), ": no answer to ", step_, " for ",
                                   to_seconds(settings_.connect_timeout_ns), " s", advice())));
  }

  void fail_step(const std::string& why) {
    fail(absl::UnavailableError(absl::StrCat(where(), ": ", step_, ": ", why, advice())));
  }

  void fail(Status status) {
    timer_.cancel();
    if (done_) std::exchange(done_, nullptr)(std::move(status), {});
  }

  MetaClientSettings settings_;
  MetaConnectionEvents events_;
  OnWelcome done_;  // empty once called
  asio::steady_timer timer_;
  tcp::socket socket_;
  std::unique_ptr<ByteStream> stream_;
  std::shared_ptr<MetaConnection> connection_;
  std::string step_;
  bool welcomed_ = false;
};

}  // namespace

void connect_meta(asio::any_io_executor executor, const MetaClientSettings& settings,
                  MetaConnectionEvents events, OnWelcome on_welcome) {
  const asio::any_io_executor strand = asio::make_strand(executor);
  const auto attempt = std::make_shared<Attempt>(strand, settings, std::move(events), std::move(on_welcome));
  asio::post(strand, [attempt] { attempt->start(); });
}

}  // namespace tessera::transport
