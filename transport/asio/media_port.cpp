#include "transport/asio/media_port.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "base/log.h"
#include "transport/nal.h"

namespace tessera::transport {
namespace {

constexpr DurationNs kTapKeyFrameIntervalNs = 2 * kNsPerSecond;

}  // namespace

MediaPort::MediaPort(asio::any_io_executor executor, const Clock& clock)
    : clock_(clock), timer_(std::move(executor)) {}
MediaPort::~MediaPort() = default;

StatusOr<std::shared_ptr<MediaPort>> MediaPort::open(asio::any_io_executor executor,
                                                     const UdpSocketSettings& settings, const Clock& clock) {
  const asio::any_io_executor strand = asio::make_strand(executor);
  std::shared_ptr<MediaPort> self(new MediaPort(strand, clock));
  const auto handler = [weak = std::weak_ptr(self)](const PeerAddress& from,
                                                    std::span<const uint8_t> datagram) {
    if (const auto port = weak.lock()) port->on_datagram(from, datagram);
  };
  TESSERA_ASSIGN_OR_RETURN(self->socket_, UdpSocket::open(strand, settings, handler));
  self->socket_->start();
  return self;
}

void MediaPort::close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
  timer_.cancel();
  socket_->close();
}

Status MediaPort::add_session(SessionId session, const SessionToken& token, std::unique_ptr<RtpSender> sender,
                              MediaSessionEvents events, const std::optional<SrtpKeys>& srtp) {
  std::unique_ptr<Srtp> protection;
  if (srtp) {
    TESSERA_ASSIGN_OR_RETURN(protection, Srtp::create(srtp->server, srtp->client));
  }
  const std::lock_guard lock(mutex_);
  TESSERA_RETURN_IF_ERROR(binding_.add(session, token));
  Session& made = sessions_[session];
  made.sender = std::move(sender);
  made.events = std::make_shared<const MediaSessionEvents>(std::move(events));
  made.srtp = std::move(protection);
  return absl::OkStatus();
}

RtpSenderStats MediaPort::remove_session(SessionId session, const std::string& reason) {
  const std::lock_guard lock(mutex_);
  const auto found = sessions_.find(session);
  if (found == sessions_.end()) return {};
  const Datagram bye = found->second.sender->make_bye(clock_.now(), reason);
  if (const auto address = binding_.address_of(session)) send(*address, found->second, bye);
  for (auto& [id, tap] : found->second.taps) tap->send(*socket_, bye);
  binding_.remove(session);
  const RtpSenderStats sent = found->second.sender->stats();
  sessions_.erase(found);
  return sent;
}

void MediaPort::on_datagram(const PeerAddress& from, std::span<const uint8_t> datagram) {
  Calls calls;
  {
    const std::lock_guard lock(mutex_);
    if (closed_) return;
    const RoutedDatagram routed = binding_.route(from, datagram);
    if (!routed.answer.empty()) socket_->send(from, routed.answer);
    if (routed.session) {
      handle(routed, datagram, calls);
      schedule();
    } else {
      log_dropped();
    }
  }
  for (const auto& call : calls) call();
}

void MediaPort::log_dropped() {
  const auto count = drop_log_.event(clock_.now());
  if (!count) return;
  const BindingStats& s = binding_.stats();
  log_event(spdlog::level::info, "datagrams dropped",
            {{"count", *count},
             {"all_unknown_address", s.unknown_address},
             {"all_bad_token", s.bad_token},
             {"all_malformed", s.malformed}});
}

void MediaPort::handle(const RoutedDatagram& routed, std::span<const uint8_t> datagram, Calls& calls) {
  Session& session = sessions_.at(*routed.session);
  if (routed.kind == DatagramKind::hello && routed.address_changed) {
    session.newest_pose = {};  // it may be another client, which counts from the start
    calls.push_back([events = session.events] {
      if (events->on_bound) events->on_bound();
    });
  } else if (routed.kind == DatagramKind::rtcp) {
    on_feedback(session, datagram, calls);
    pump(*routed.session, session);
  } else if (routed.kind == DatagramKind::pose) {
    const StatusOr<SequencedPose> pose = parse_pose_datagram(datagram);
    if (!pose.ok() || session.srtp) return log_dropped();
    if (!session.newest_pose.accept(pose->sequence)) return;
    calls.push_back([events = session.events, pose = *pose] {
      if (events->on_pose) events->on_pose(pose);
    });
  }
}

void MediaPort::on_feedback(Session& session, std::span<const uint8_t> datagram, Calls& calls) {
  Datagram clear;
  if (session.srtp) {
    StatusOr<Datagram> unprotected = session.srtp->unprotect(datagram);
    if (!unprotected.ok()) return log_dropped();
    clear = *std::move(unprotected);
    datagram = clear;
  }
  if (!session.sender->on_rtcp(clock_.now(), datagram).ok()) return log_dropped();
  if (session.sender->take_key_frame_request()) {
    calls.push_back([events = session.events] {
      if (events->on_key_frame_request) events->on_key_frame_request();
    });
  }
  if (session.sender->peer_left() && !std::exchange(session.left, true)) {
    calls.push_back([events = session.events] {
      if (events->on_left) events->on_left();
    });
  }
}

void MediaPort::pump(SessionId id, Session& session) {
  const auto address = binding_.address_of(id);
  if (!address) return;
  for (Datagram& datagram : session.sender->poll(clock_.now())) {
    for (auto& [tap_id, tap] : session.taps) tap->send(*socket_, datagram);
    send(*address, session, std::move(datagram));
  }
}

void MediaPort::send(const PeerAddress& to, Session& session, Datagram datagram) {
  if (session.srtp && !session.srtp->protect(datagram).ok()) return;  // never in clear text
  socket_->send(to, std::move(datagram));
}

// One timer for all sessions, at the earliest of their next events.
void MediaPort::schedule() {
  std::optional<TimeNs> next;
  for (const auto& [id, session] : sessions_) {
    if (!binding_.address_of(id)) continue;
    const TimeNs due = session.sender->next_event_ns();
    next = next ? std::min(*next, due) : due;
  }
  if (closed_ || !next || (timer_due_ns_ && *timer_due_ns_ <= *next)) return;
  timer_due_ns_ = next;
  timer_.expires_after(std::chrono::nanoseconds(std::max<DurationNs>(0, *next - clock_.now())));
  timer_.async_wait([self = shared_from_this()](SystemError error) {
    if (!error) self->on_timer();
  });
}

void MediaPort::on_timer() {
  const std::lock_guard lock(mutex_);
  timer_due_ns_.reset();
  if (closed_) return;
  for (auto& [id, session] : sessions_) pump(id, session);
  schedule();
}

StatusOr<const MediaPort::Session*> MediaPort::find_bound(SessionId session) const {
  const auto found = sessions_.find(session);
  if (found == sessions_.end()) return absl::NotFoundError(absl::StrCat("no session ", session));
  if (!binding_.address_of(session))
    return absl::FailedPreconditionError(
        absl::StrCat("session ", session, ": its client has not said hello by UDP"));
  return &found->second;
}

StatusOr<double> MediaPort::frame_budget_bits(SessionId session, DurationNs frame_interval_ns,
                                              bool key_frame) const {
  const std::lock_guard lock(mutex_);
  TESSERA_ASSIGN_OR_RETURN(const Session* s, find_bound(session));
  return s->sender->frame_budget_bits(frame_interval_ns, key_frame);
}

StatusOr<uint32_t> MediaPort::send_frame(SessionId session, TimeNs capture_ns,
                                         std::span<const uint8_t> access_unit, bool key_frame) {
  Calls calls;
  StatusOr<uint32_t> timestamp;
  {
    const std::lock_guard lock(mutex_);
    TESSERA_RETURN_IF_ERROR(find_bound(session).status());
    Session& s = sessions_.at(session);
    timestamp = s.sender->send_frame(clock_.now(), capture_ns, access_unit, key_frame);
    if (timestamp.ok()) on_sent_frame(s, access_unit, key_frame, calls);
    pump(session, s);
    schedule();
  }
  for (const auto& call : calls) call();
  return timestamp;
}

void MediaPort::on_sent_frame(Session& session, std::span<const uint8_t> access_unit, bool key_frame,
                              Calls& calls) {
  if (session.sender->codec() != AtlasCodec::h264) return;  // each picture is a key frame
  const TimeNs now = clock_.now();
  if (key_frame) {
    session.key_frame_ns = now;
    session.parameter_sets.clear();
    for (Nal nal : split_annex_b(access_unit)) {
      if (nal_type(nal) == kNalSps || nal_type(nal) == kNalPps) append_annex_b(session.parameter_sets, nal);
    }
  } else if (!session.taps.empty() && now - session.key_frame_ns >= kTapKeyFrameIntervalNs) {
    session.key_frame_ns = now;
    calls.push_back([events = session.events] {
      if (events->on_key_frame_request) events->on_key_frame_request();
    });
  }
}

StatusOr<TapId> MediaPort::add_tap(SessionId session, const PeerAddress& to,
                                   const std::optional<SrtpKey>& srtp) {
  const std::lock_guard lock(mutex_);
  const auto found = sessions_.find(session);
  if (found == sessions_.end()) return absl::NotFoundError(absl::StrCat("there is no session ", session));
  Session& s = found->second;
  if (s.taps.size() >= kMaxTaps)
    return absl::ResourceExhaustedError(
        absl::StrCat("session ", session, " is forwarded to ", kMaxTaps, " receivers already; end one"));
  TESSERA_ASSIGN_OR_RETURN(auto tap, MediaTap::create(to, s.sender->ids(), srtp));
  s.taps.emplace(next_tap_, std::move(tap));
  s.key_frame_ns = clock_.now() - kTapKeyFrameIntervalNs;  // with the next frame
  return next_tap_++;
}

void MediaPort::remove_tap(SessionId session, TapId tap) {
  const std::lock_guard lock(mutex_);
  const auto found = sessions_.find(session);
  if (found != sessions_.end()) found->second.taps.erase(tap);
}

StatusOr<uint64_t> MediaPort::tap_packets(SessionId session, TapId tap) const {
  const std::lock_guard lock(mutex_);
  const auto found = sessions_.find(session);
  if (found == sessions_.end() || !found->second.taps.contains(tap))
    return absl::NotFoundError(absl::StrCat("session ", session, " has ended"));
  return found->second.taps.at(tap)->packets();
}

StatusOr<std::vector<uint8_t>> MediaPort::parameter_sets(SessionId session) const {
  const std::lock_guard lock(mutex_);
  const auto found = sessions_.find(session);
  if (found == sessions_.end()) return absl::NotFoundError(absl::StrCat("there is no session ", session));
  if (found->second.parameter_sets.empty())
    return absl::FailedPreconditionError(
        absl::StrCat("session ", session, " has sent no frame yet; connect its client first"));
  return found->second.parameter_sets;
}

Status MediaPort::set_rate(SessionId session, double rate_bps) {
  const std::lock_guard lock(mutex_);
  const auto found = sessions_.find(session);
  if (found == sessions_.end()) return absl::NotFoundError(absl::StrCat("no session ", session));
  if (!(rate_bps > 0)) return absl::InvalidArgumentError("the rate must be above 0");
  found->second.sender->set_rate(rate_bps);
  return absl::OkStatus();
}

BindingStats MediaPort::binding_stats() const {
  const std::lock_guard lock(mutex_);
  return binding_.stats();
}

std::optional<StreamIds> MediaPort::stream_ids(SessionId session) const {
  const std::lock_guard lock(mutex_);
  const auto found = sessions_.find(session);
  return found == sessions_.end() ? std::nullopt : std::optional(found->second.sender->ids());
}

std::optional<RtpSenderStats> MediaPort::sender_stats(SessionId session) const {
  const std::lock_guard lock(mutex_);
  const auto found = sessions_.find(session);
  return found == sessions_.end() ? std::nullopt : std::optional(found->second.sender->stats());
}

std::optional<PeerReport> MediaPort::peer_report(SessionId session) const {
  const std::lock_guard lock(mutex_);
  const auto found = sessions_.find(session);
  return found == sessions_.end() ? std::nullopt : found->second.sender->peer_report();
}

}  // namespace tessera::transport
