#include "transport/asio/media_client.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "transport/asio/endpoint.h"
#include "transport/datagram.h"

namespace tessera::transport {

MediaClient::MediaClient(asio::any_io_executor executor, const MediaClientSettings& settings,
                         const Clock& clock, MediaClientEvents events)
    : clock_(clock),
      settings_(settings),
      events_(std::move(events)),
      timer_(std::move(executor)),
      receiver_(settings.receiver),
      nonce_(settings.receiver.seed) {}

StatusOr<std::shared_ptr<MediaClient>> MediaClient::open(asio::any_io_executor executor,
                                                         const MediaClientSettings& settings,
                                                         const Clock& clock, MediaClientEvents events) {
  TESSERA_ASSIGN_OR_RETURN(const asio::ip::address server, parse_address(settings.server_address));
  const asio::any_io_executor strand = asio::make_strand(executor);
  std::shared_ptr<MediaClient> self(new MediaClient(strand, settings, clock, std::move(events)));
  if (settings.srtp) {
    TESSERA_ASSIGN_OR_RETURN(self->srtp_, Srtp::create(settings.srtp->client, settings.srtp->server));
  }
  self->server_ = peer_address({server, settings.server_port});
  UdpSocketSettings socket;
  socket.address = settings.bind_address;
  if (socket.address.empty()) socket.address = server.is_v6() ? "::" : "0.0.0.0";
  const auto handler = [weak = std::weak_ptr(self)](const PeerAddress& from,
                                                    std::span<const uint8_t> datagram) {
    if (const auto client = weak.lock()) client->on_datagram(from, datagram);
  };
  TESSERA_ASSIGN_OR_RETURN(self->socket_, UdpSocket::open(strand, socket, handler));
  self->socket_->start();
  self->last_answer_ns_ = self->next_hello_ns_ = clock.now();
  asio::post(strand, [self] { self->step(); });
  return self;
}

void MediaClient::close(const std::string& reason) {
  const std::lock_guard lock(mutex_);
  if (std::exchange(closed_, true)) return;
  if (bound_) send_feedback(receiver_.make_bye(clock_.now(), reason));
  timer_.cancel();
  socket_->close();
}

void MediaClient::send_feedback(Datagram datagram) {
  if (srtp_ && !srtp_->protect(datagram).ok()) return;  // never in clear text
  socket_->send(server_, std::move(datagram));
}

// What is not right is counted by the receiver, or dropped by SRTP.
void MediaClient::on_media(std::span<const uint8_t> datagram, DatagramKind kind) {
  Datagram clear;
  if (srtp_) {
    StatusOr<Datagram> unprotected = srtp_->unprotect(datagram);
    if (!unprotected.ok()) return;
    clear = *std::move(unprotected);
    datagram = clear;
  }
  const TimeNs now = clock_.now();
  (void)(kind == DatagramKind::rtcp ? receiver_.on_rtcp(now, datagram) : receiver_.on_rtp(now, datagram));
}

void MediaClient::send_hello(TimeNs now) {
  ++nonce_;
  hello_sent_ns_ = now;
  next_hello_ns_ = now + (bound_ ? settings_.keep_alive_ns : settings_.hello_interval_ns);
  socket_->send(server_, write_hello({.token = settings_.token, .nonce = nonce_}));
}

std::function<void()> MediaClient::on_hello_answer(std::span<const uint8_t> datagram) {
  const auto answer = parse_hello_answer(datagram);
  // Only the newest hello's answer measures the round trip.
  if (!answer.ok() || answer->nonce != nonce_) return {};
  if (answer->status == HelloStatus::unsupported_version) {
    Status status =
        absl::UnimplementedError(absl::StrCat("the server's media port speaks version ", answer->version,
                                              ", this client ", kDatagramVersion, ": update the older end"));
    return [self = shared_from_this(), status] { self->fail(status); };
  }
  last_answer_ns_ = clock_.now();
  round_trip_ns_ = last_answer_ns_ - hello_sent_ns_;
  receiver_.set_rtt(*round_trip_ns_);
  if (std::exchange(bound_, true)) return {};
  next_hello_ns_ = last_answer_ns_ + settings_.keep_alive_ns;
  return [self = shared_from_this(), rtt = *round_trip_ns_] {
    if (self->events_.on_bound) self->events_.on_bound(rtt);
  };
}

void MediaClient::on_datagram(const PeerAddress& from, std::span<const uint8_t> datagram) {
  if (from != server_) return;
  std::function<void()> call;
  {
    const std::lock_guard lock(mutex_);
    if (closed_) return;
    const DatagramKind kind = classify(datagram);
    if (kind == DatagramKind::hello_answer) call = on_hello_answer(datagram);
    if (kind == DatagramKind::rtp || kind == DatagramKind::rtcp) on_media(datagram, kind);
  }
  if (call) call();
  step();
}

// Sends what is due, hands out what is complete, and sets the timer.
void MediaClient::step() {
  std::vector<ReceivedFrame> frames;
  Status failure;
  {
    const std::lock_guard lock(mutex_);
    if (closed_) return;
    const TimeNs now = clock_.now();
    if (now - last_answer_ns_ > patience_ns()) {
      const std::string cause = socket_->last_error();
      failure = absl::DeadlineExceededError(absl::StrCat(
          "no answer by UDP from ", settings_.server_address, ":", settings_.server_port, " for ",
          to_seconds(patience_ns()), " s", cause.empty() ? "" : absl::StrCat(" (", cause, ")"),
          ": does a firewall block the port, is the token right, does the session still exist?"));
    } else {
      if (now >= next_hello_ns_) send_hello(now);
      for (Datagram& datagram : receiver_.poll(now)) send_feedback(std::move(datagram));
      while (auto frame = receiver_.take_frame()) frames.push_back(*std::move(frame));
      schedule();
    }
  }
  if (!failure.ok()) return fail(std::move(failure));
  for (ReceivedFrame& frame : frames) {
    if (events_.on_frame) events_.on_frame(std::move(frame));
  }
}

void MediaClient::schedule() {
  TimeNs next = std::min(next_hello_ns_, last_answer_ns_ + patience_ns() + 1);
  next = std::min(next, receiver_.next_event_ns());
  timer_.expires_after(std::chrono::nanoseconds(std::max<DurationNs>(0, next - clock_.now())));
  timer_.async_wait([self = shared_from_this()](SystemError error) {
    if (!error) self->step();
  });
}

void MediaClient::fail(Status status) {
  {
    const std::lock_guard lock(mutex_);
    if (std::exchange(closed_, true)) return;
    timer_.cancel();
    socket_->close();
  }
  if (events_.on_failed) events_.on_failed(std::move(status));
}

bool MediaClient::send_pose(const SequencedPose& pose) {
  const std::lock_guard lock(mutex_);
  return bound_ && !closed_ && !srtp_ && socket_->send(server_, write_pose_datagram(pose));
}

void MediaClient::request_key_frame() {
  {
    const std::lock_guard lock(mutex_);
    receiver_.request_key_frame();
  }
  asio::post(timer_.get_executor(), [self = shared_from_this()] { self->step(); });
}

RtpReceiverStats MediaClient::stats() const {
  const std::lock_guard lock(mutex_);
  return receiver_.stats();
}

std::optional<DurationNs> MediaClient::round_trip_ns() const {
  const std::lock_guard lock(mutex_);
  return round_trip_ns_;
}

}  // namespace tessera::transport
