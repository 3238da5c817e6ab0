#include "server/stream_server.h"

#include <openssl/rand.h>

#include <algorithm>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <condition_variable>
#include <deque>
#include <future>
#include <map>
#include <thread>
#include <utility>

#include "base/log.h"
#include "transport/asio/endpoint.h"
#include "transport/sdp.h"

namespace tessera::server {
namespace {

namespace asio = transport::asio;
using transport::SessionId;
using transport::SessionToken;

Status fill_random(std::span<uint8_t> out) {
  if (RAND_bytes(out.data(), static_cast<int>(out.size())) != 1)
    return absl::InternalError("RAND_bytes: no random numbers to be had");
  return absl::OkStatus();
}

Status no_such_session(SessionId id) {
  return absl::NotFoundError(absl::StrCat("there is no session ", id));
}

void add_counters(StreamedSessionStats& sum, const StreamedSessionStats& s) {
  sum.frames_sent += s.frames_sent;
  sum.frames_skipped += s.frames_skipped;
  sum.key_frames += s.key_frames;
  sum.meta_bytes += s.meta_bytes;
  sum.media += s.media;
}

uint64_t texels(const SessionSettings& settings) {
  return uint64_t{settings.layout.width} * settings.layout.height;
}

struct Entry {
  SessionToken token;
  std::shared_ptr<StreamedSession> session;
};

// What one client receives by UDP. Each has its own: nothing of the client before is left in queues and
// counters, and no key protects two streams.
struct MediaStream {
  std::unique_ptr<transport::RtpSender> sender;
  std::optional<transport::SrtpKeys> srtp;
};

StatusOr<MediaStream> make_stream(AtlasCodec codec, const RateSplit& rate, bool encrypted) {
  MediaStream stream;
  std::array<uint8_t, 8> seed{};
  TESSERA_RETURN_IF_ERROR(fill_random(seed));
  transport::RtpSenderSettings rtp{.codec = codec, .pacer = {.rate_bps = rate.bitrate_bps}};
  std::copy(seed.begin(), seed.end(), reinterpret_cast<uint8_t*>(&rtp.seed));
  TESSERA_ASSIGN_OR_RETURN(stream.sender, transport::RtpSender::create(rtp));
  if (encrypted) {
    stream.srtp.emplace();
    TESSERA_RETURN_IF_ERROR(fill_random(stream.srtp->server));
    TESSERA_RETURN_IF_ERROR(fill_random(stream.srtp->client));
  }
  return stream;
}

}  // namespace

Status check_exposure(const StreamServerSettings& settings) {
  TESSERA_ASSIGN_OR_RETURN(const asio::ip::address media, transport::parse_address(settings.media.address));
  TESSERA_ASSIGN_OR_RETURN(const asio::ip::address meta, transport::parse_address(settings.meta.address));
  if (settings.insecure || (media.is_loopback() && meta.is_loopback())) return absl::OkStatus();
  if (settings.meta.tls) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "binding ", settings.meta.address, " and ", settings.media.address,
      " would send tokens and pictures in clear text: give a TLS certificate, or say --insecure"));
}

struct StreamServer::Impl {
  Impl(const StreamServerSettings& s, const Clock& c) : settings(s), clock(c), work(io.get_executor()) {}

  Status open();
  void run_renderer();
  std::shared_ptr<StreamedSession> next_ready(std::unique_lock<std::mutex>& lock);
  void do_device_work(std::unique_lock<std::mutex>& lock);
  void end_idle(std::unique_lock<std::mutex>& lock);
  void wake();
  StatusOr<transport::Admission> admit(const transport::Hello& hello, const std::string& peer);
  StatusOr<Entry> find_token(const SessionToken& token) const;
  StatusOr<transport::Welcome> open_media(const Entry& entry);
  transport::MediaSessionEvents media_events(const std::shared_ptr<StreamedSession>& session);
  Status check_room(const SessionSettings& wanted) const;
  void refuse(const Status& reason, const std::string& peer);
  StatusOr<std::shared_ptr<StreamedSession>> find(SessionId id) const;
  Status end(SessionId id, const Status& reason);

  const StreamServerSettings settings;
  const Clock& clock;
  asio::io_context io;
  asio::executor_work_guard<asio::io_context::executor_type> work;
  std::shared_ptr<transport::MediaPort> media;
  std::shared_ptr<transport::MetaListener> meta;

  mutable std::mutex mutex;  // of all below
  std::condition_variable changed;
  std::map<SessionId, Entry> sessions;
  SessionId next_id = 1;
  std::vector<std::shared_ptr<StreamedSession>>
      ended;  // whose device objects the render thread has to release
  std::deque<std::packaged_task<Status()>> device_work;
  StreamedSessionStats ended_counters;
  std::map<absl::StatusCode, uint64_t> refused_clients;
  transport::LogLimiter refusal_log;
  bool stopping = false, woken = false;
  TimeNs idle_check_ns = 0;  // the next one
  std::thread io_thread, render_thread;
};

Status StreamServer::Impl::open() {
  TESSERA_RETURN_IF_ERROR(check_exposure(settings));
  TESSERA_ASSIGN_OR_RETURN(media, transport::MediaPort::open(asio::make_strand(io), settings.media, clock));
  TESSERA_ASSIGN_OR_RETURN(
      meta, transport::MetaListener::open(io.get_executor(), settings.meta,
                                          [this](const transport::Hello& hello, const std::string& peer) {
                                            auto admission = admit(hello, peer);
                                            if (!admission.ok()) refuse(admission.status(), peer);
                                            return admission;
                                          }));
  io_thread = std::thread([this] { io.run(); });
  render_thread = std::thread([this] { run_renderer(); });
  return absl::OkStatus();
}

void StreamServer::Impl::wake() {
  {
    const std::lock_guard lock(mutex);
    woken = true;
  }
  changed.notify_one();
}

void StreamServer::Impl::do_device_work(std::unique_lock<std::mutex>& lock) {
  while (!ended.empty() || !device_work.empty()) {
    const auto released = std::exchange(ended, {});
    auto tasks = std::exchange(device_work, {});
    lock.unlock();
    for (const auto& session : released) session->release();
    for (auto& task : tasks) task();
    lock.lock();
  }
}

// Whoever made them has forgotten them, or died: they must not take places for ever.
void StreamServer::Impl::end_idle(std::unique_lock<std::mutex>& lock) {
  if (settings.idle_timeout_ns == 0 || clock.now() < idle_check_ns) return;
  idle_check_ns = clock.now() + std::min(settings.idle_timeout_ns / 4, kNsPerSecond);
  std::vector<SessionId> idle;
  for (const auto& [id, entry] : sessions) {
    const std::optional<TimeNs> since = entry.session->idle_since();
    if (since && clock.now() - *since > settings.idle_timeout_ns) idle.push_back(id);
  }
  if (idle.empty()) return;
  const Status reason = absl::DeadlineExceededError(
      absl::StrCat("no client for ", to_seconds(settings.idle_timeout_ns), " s (--idle-timeout)"));
  lock.unlock();
  for (const SessionId id : idle) {
    log_event(spdlog::level::info, "session ended", {{"session", id}, {"reason", reason.message()}});
    (void)end(id, reason);
  }
  lock.lock();
}

// Earliest deadline first: under overload all sessions fall behind evenly. Null when the server stops.
std::shared_ptr<StreamedSession> StreamServer::Impl::next_ready(std::unique_lock<std::mutex>& lock) {
  while (!stopping) {
    end_idle(lock);
    do_device_work(lock);
    std::shared_ptr<StreamedSession> earliest;
    for (const auto& [id, entry] : sessions) {
      if (entry.session->ready() && (!earliest || entry.session->due_ns() < earliest->due_ns()))
        earliest = entry.session;
    }
    const DurationNs wait = earliest ? earliest->due_ns() - clock.now() : kNsPerSecond;
    if (earliest && wait <= 0) return earliest;
    woken = false;
    changed.wait_for(lock, std::chrono::nanoseconds(wait), [this] { return stopping || woken; });
  }
  return nullptr;
}

void StreamServer::Impl::run_renderer() {
  std::unique_lock lock(mutex);
  while (const std::shared_ptr<StreamedSession> session = next_ready(lock)) {
    lock.unlock();
    if (const Status status = session->render(); !status.ok()) {
      log_event(spdlog::level::err, "session failed",
                {{"session", session->id()}, {"reason", status.ToString()}});
      // Whatever its code, to the client it is a failure of the server's.
      (void)end(session->id(), absl::InternalError(absl::StrCat("rendering failed: ", status.message())));
    }
    lock.lock();
  }
}

transport::MediaSessionEvents StreamServer::Impl::media_events(
    const std::shared_ptr<StreamedSession>& session) {
  const std::weak_ptr<StreamedSession> weak = session;
  const auto with = [this, weak](auto action) {
    if (const auto held = weak.lock()) action(*held), wake();
  };
  return {.on_bound = [with] { with([](StreamedSession& s) { s.on_bound(); }); },
          .on_pose =
              [with](const transport::SequencedPose& p) { with([&](StreamedSession& s) { s.on_pose(p); }); },
          .on_key_frame_request = [with] { with([](StreamedSession& s) { s.on_key_frame_request(); }); },
          .on_left = {}};
}

StatusOr<Entry> StreamServer::Impl::find_token(const SessionToken& token) const {
  const std::lock_guard lock(mutex);
  const Entry* found = nullptr;
  for (const auto& [id, entry] : sessions)
    if (transport::equal_in_constant_time(entry.token, token)) found = &entry;
  if (!found) return absl::UnauthenticatedError("no session has this token; create one and use its token");
  return *found;
}

StatusOr<transport::Welcome> StreamServer::Impl::open_media(const Entry& entry) {
  const SessionSettings& s = entry.session->settings();
  const RateSplit rate = entry.session->rate();
  TESSERA_ASSIGN_OR_RETURN(MediaStream stream, make_stream(s.codec, rate, settings.meta.tls != nullptr));
  const transport::StreamIds ids = stream.sender->ids();
  TESSERA_RETURN_IF_ERROR(media->add_session(entry.session->id(), entry.token, std::move(stream.sender),
                                             media_events(entry.session), stream.srtp));
  return transport::Welcome{.session = entry.session->id(),
                            .media_port = media->port(),
                            .stream = ids,
                            .atlas_width = static_cast<uint16_t>(s.layout.width),
                            .atlas_height = static_cast<uint16_t>(s.layout.height),
                            .codec = s.codec,
                            .frames_per_second = static_cast<float>(rate.frames_per_second),
                            .srtp = stream.srtp};
}

StatusOr<transport::Admission> StreamServer::Impl::admit(const transport::Hello& hello,
                                                         const std::string& peer) {
  TESSERA_ASSIGN_OR_RETURN(const Entry entry, find_token(hello.token));
  const std::shared_ptr<StreamedSession> session = entry.session;
  TESSERA_RETURN_IF_ERROR(session->admit(hello.client));
  StatusOr<transport::Welcome> welcome = open_media(entry);
  if (!welcome.ok()) {
    session->on_closed(welcome.status());
    return welcome.status();
  }
  log_event(spdlog::level::info, "client connected",
            {{"session", session->id()}, {"name", hello.client.name}, {"peer", peer}});
  return transport::Admission{
      .welcome = *std::move(welcome),
      .events = {.on_frame =
                     [this, session](transport::FrameType type, std::span<const uint8_t> payload) {
                       const Status status = session->on_frame(type, payload);
                       wake();
                       return status;
                     },
                 .on_closed =
                     [session](const Status& reason) {
                       log_event(spdlog::level::info, "client left",
                                 {{"session", session->id()}, {"reason", reason.ToString()}});
                       session->on_closed(reason);
                     }},
      .on_connected = [this, session](std::shared_ptr<transport::MetaConnection> connection) {
        session->on_connected(std::move(connection));
        wake();
      }};
}

// Whoever guesses at tokens must not fill the log.
void StreamServer::Impl::refuse(const Status& reason, const std::string& peer) {
  std::optional<uint64_t> count;
  {
    const std::lock_guard lock(mutex);
    ++refused_clients[reason.code()];
    count = refusal_log.event(clock.now());
  }
  if (count) {
    log_event(spdlog::level::warn, "clients refused",
              {{"count", *count}, {"last_peer", peer}, {"last_reason", reason.ToString()}});
  }
}

Status StreamServer::Impl::check_room(const SessionSettings& wanted) const {
  if (sessions.size() >= settings.max_sessions) {
    return absl::ResourceExhaustedError(
        absl::StrCat("all ", settings.max_sessions, " sessions are taken; end one or raise --max-sessions"));
  }
  uint64_t taken = 0;
  for (const auto& [id, entry] : sessions) taken += texels(entry.session->settings());
  if (taken + texels(wanted) <= settings.max_atlas_texels) return absl::OkStatus();
  return absl::ResourceExhaustedError(
      absl::StrCat("the atlases of all sessions have ", taken, " texels and this one would add ",
                   texels(wanted), " to the ", settings.max_atlas_texels,
                   " allowed; end a session, take a smaller atlas or raise --max-atlas-mtexels"));
}

Status StreamServer::Impl::end(SessionId id, const Status& reason) {
  TESSERA_ASSIGN_OR_RETURN(const std::shared_ptr<StreamedSession> session, find(id));
  session->close(reason);
  {
    const std::lock_guard lock(mutex);
    if (sessions.erase(id) == 0) return no_such_session(id);  // another call was faster
    session->on_closed(reason);
    add_counters(ended_counters, session->stats());
    ended.push_back(session);
    woken = true;
  }
  changed.notify_one();
  return absl::OkStatus();
}

StreamServer::StreamServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

StatusOr<std::unique_ptr<StreamServer>> StreamServer::create(const StreamServerSettings& settings,
                                                             const Clock& clock) {
  std::unique_ptr<StreamServer> server(new StreamServer(std::make_unique<Impl>(settings, clock)));
  TESSERA_RETURN_IF_ERROR(server->impl_->open());
  return server;
}

StreamServer::~StreamServer() {
  Impl& s = *impl_;
  {
    const std::lock_guard lock(s.mutex);
    s.stopping = true;
  }
  s.changed.notify_all();
  if (s.render_thread.joinable()) s.render_thread.join();
  end_all("");
  if (s.meta) s.meta->close();
  if (s.media) s.media->close();
  s.work.reset();  // what is queued still goes out, within close_timeout_ns
  if (s.io_thread.joinable()) s.io_thread.join();
  // The render thread is no more: the device is this thread's now.
  std::unique_lock lock(s.mutex);
  s.do_device_work(lock);
}

StatusOr<SessionTicket> StreamServer::create_session(RendererFactory renderer,
                                                     const SessionSettings& settings) {
  Impl& s = *impl_;
  SessionTicket ticket{.media_port = media_port(), .meta_port = meta_port()};
  TESSERA_RETURN_IF_ERROR(fill_random(ticket.token));
  const std::lock_guard lock(s.mutex);
  TESSERA_RETURN_IF_ERROR(s.check_room(settings));
  ticket.session = s.next_id++;
  s.sessions[ticket.session] = {
      ticket.token, std::make_shared<StreamedSession>(ticket.session, std::move(renderer), settings, s.media,
                                                      s.clock, s.settings.on_rendered)};
  return ticket;
}

StatusOr<Forwarding> StreamServer::forward(SessionId session, const transport::PeerAddress& to) {
  Impl& s = *impl_;
  transport::SdpSettings sdp{.address = transport::to_string(to), .port = to.port, .retransmission = false};
  TESSERA_ASSIGN_OR_RETURN(const std::shared_ptr<StreamedSession> found, s.find(session));
  if (const AtlasCodec codec = found->settings().codec; codec != AtlasCodec::h264) {
    return absl::FailedPreconditionError(
        absl::StrCat("session ", session, " streams ", std::string(name_of(codec)),
                     ", which players do not know: forward a session whose codec is H.264"));
  }
  const std::optional<transport::StreamIds> ids = s.media->stream_ids(session);
  if (!ids) {
    return absl::FailedPreconditionError(
        absl::StrCat("session ", session, " has no client, so there is no stream: connect its client first"));
  }
  sdp.stream = *ids;
  if (s.settings.meta.tls) {
    sdp.srtp.emplace();
    TESSERA_RETURN_IF_ERROR(fill_random(*sdp.srtp));
  }
  TESSERA_ASSIGN_OR_RETURN(const std::vector<uint8_t> parameter_sets, s.media->parameter_sets(session));
  Forwarding forwarding{.session = session};
  TESSERA_ASSIGN_OR_RETURN(forwarding.sdp, transport::make_sdp(sdp, parameter_sets));
  TESSERA_ASSIGN_OR_RETURN(forwarding.tap, s.media->add_tap(session, to, sdp.srtp));
  return forwarding;
}

void StreamServer::end_forward(const Forwarding& forwarding) {
  impl_->media->remove_tap(forwarding.session, forwarding.tap);
}

StatusOr<uint64_t> StreamServer::forwarded_packets(const Forwarding& forwarding) const {
  return impl_->media->tap_packets(forwarding.session, forwarding.tap);
}

Status StreamServer::end_session(SessionId session, const std::string& reason) {
  return impl_->end(session, reason.empty() ? absl::OkStatus() : absl::CancelledError(reason));
}

void StreamServer::end_all(const std::string& reason) {
  std::vector<SessionId> open;
  {
    const std::lock_guard lock(impl_->mutex);
    for (const auto& [id, entry] : impl_->sessions) open.push_back(id);
  }
  for (const SessionId id : open) (void)end_session(id, reason);
}

StatusOr<std::shared_ptr<StreamedSession>> StreamServer::Impl::find(SessionId id) const {
  const std::lock_guard lock(mutex);
  const auto found = sessions.find(id);
  if (found == sessions.end()) return no_such_session(id);
  return found->second.session;
}

Status StreamServer::set_rate(SessionId session, double bitrate_bps, double frames_per_second) {
  TESSERA_ASSIGN_OR_RETURN(const std::shared_ptr<StreamedSession> found, impl_->find(session));
  return found->set_rate(bitrate_bps, frames_per_second);
}

StatusOr<StreamedSessionStats> StreamServer::stats(SessionId session) const {
  TESSERA_ASSIGN_OR_RETURN(const std::shared_ptr<StreamedSession> found, impl_->find(session));
  return found->stats();
}

StreamServerStats StreamServer::stats() const {
  const std::lock_guard lock(impl_->mutex);
  StreamServerStats stats{.ended = impl_->ended_counters,
                          .refused_clients = impl_->refused_clients,
                          .binding = impl_->media->binding_stats(),
                          .dropped_datagrams = impl_->media->dropped_datagrams()};
  for (const auto& [id, entry] : impl_->sessions) {
    stats.sessions.emplace(id, entry.session->stats());
    stats.atlas_texels += texels(entry.session->settings());
  }
  return stats;
}

StatusOr<std::vector<FrameRecord>> StreamServer::records(SessionId session, uint64_t first,
                                                         uint64_t& next) const {
  TESSERA_ASSIGN_OR_RETURN(const std::shared_ptr<StreamedSession> found, impl_->find(session));
  return found->records(first, next);
}

bool StreamServer::has(SessionId session) const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->sessions.contains(session);
}

size_t StreamServer::sessions() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->sessions.size();
}

Status StreamServer::run_on_device(const std::function<Status()>& work) {
  std::packaged_task<Status()> task(work);
  std::future<Status> result = task.get_future();
  {
    const std::lock_guard lock(impl_->mutex);
    if (impl_->stopping) return absl::CancelledError("the server stops");
    impl_->device_work.push_back(std::move(task));
    impl_->woken = true;
  }
  impl_->changed.notify_one();
  return result.get();
}

uint16_t StreamServer::media_port() const {
  return impl_->media->port();
}
uint16_t StreamServer::meta_port() const {
  return impl_->meta->port();
}

}  // namespace tessera::server
