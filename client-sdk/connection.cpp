#include "client-sdk/connection.h"

#include <atomic>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <future>
#include <mutex>
#include <thread>
#include <utility>

#include "base/log.h"
#include "transport/asio/media_client.h"
#include "transport/asio/meta_client.h"
#include "transport/clock_offset.h"

namespace tessera::client {
namespace {

namespace asio = transport::asio;
using transport::FrameType;

constexpr DurationNs kPingIntervalNs = kNsPerSecond;

}  // namespace

struct Connection::Impl {
  Impl(const ConnectionSettings& s, const Clock& c)
      : settings(s), clock(c), work(io.get_executor()), ping_timer(io) {}

  Status open();
  StatusOr<std::shared_ptr<transport::MetaConnection>> open_meta();
  Status open_media();
  void close();
  Status on_frame(FrameType type, std::span<const uint8_t> payload);
  void on_access_unit(const transport::ReceivedFrame& frame);
  void ping();
  void end(const Status& reason);

  const ConnectionSettings settings;
  const Clock& clock;
  std::unique_ptr<ClientCore> core;
  asio::io_context io{1};  // run by one thread: the core's receiving side
  asio::executor_work_guard<asio::io_context::executor_type> work;
  asio::steady_timer ping_timer;
  std::shared_ptr<transport::MetaConnection> meta;  // set once, before the media client opens
  std::shared_ptr<transport::MediaClient> media;
  transport::Welcome welcome;
  std::atomic<uint32_t> pose_sequence = 0;
  uint32_t ping_id = 0;  // the receiving thread's, as is
  bool closing = false;

  mutable std::mutex mutex;  // of all below
  transport::ClockOffset offset;
  Status ended;
  std::thread thread;
};

void Connection::Impl::end(const Status& reason) {
  const std::lock_guard lock(mutex);
  if (ended.ok()) ended = reason.ok() ? absl::CancelledError("the server ended the session") : reason;
}

Status Connection::Impl::open() {
  TESSERA_ASSIGN_OR_RETURN(core, ClientCore::create());
  thread = std::thread([this] { io.run(); });
  TESSERA_ASSIGN_OR_RETURN(meta, open_meta());
  TESSERA_RETURN_IF_ERROR(open_media());
  asio::post(io, [this] { ping(); });
  return absl::OkStatus();
}

StatusOr<std::shared_ptr<transport::MetaConnection>> Connection::Impl::open_meta() {
  using Result = StatusOr<std::shared_ptr<transport::MetaConnection>>;
  const auto done = std::make_shared<std::promise<Result>>();
  transport::MetaClientSettings meta_settings{.server_address = settings.server_address,
                                              .server_port = settings.meta_port,
                                              .tls = settings.tls,
                                              .connect_timeout_ns = settings.connect_timeout_ns};
  meta_settings.hello.token = settings.token;
  meta_settings.hello.client = settings.client;
  transport::connect_meta(
      io.get_executor(), meta_settings,
      {.on_frame = [this](FrameType type,
                          std::span<const uint8_t> payload) { return on_frame(type, payload); },
       .on_closed = [this](const Status& reason) { end(reason); }},
      [this, done](Result connection, const transport::Welcome& answer) {
        welcome = answer;
        done->set_value(std::move(connection));
      });
  return done->get_future().get();
}

Status Connection::Impl::open_media() {
  const auto done = std::make_shared<std::promise<Status>>();
  const auto told = std::make_shared<std::atomic<bool>>(false);
  const auto tell = [done, told](const Status& status) {
    if (!told->exchange(true)) done->set_value(status);
  };
  transport::MediaClientSettings media_settings{.server_address = settings.server_address,
                                                .server_port = welcome.media_port,
                                                .token = settings.token,
                                                .srtp = welcome.srtp,
                                                .answer_timeout_ns = settings.connect_timeout_ns};
  media_settings.receiver.payload_type = welcome.stream.payload_type;
  media_settings.receiver.rtx_payload_type = welcome.stream.rtx_payload_type;
  media_settings.receiver.ssrc = welcome.stream.ssrc;
  media_settings.receiver.rtx_ssrc = welcome.stream.rtx_ssrc;
  auto opened = transport::MediaClient::open(
      asio::make_strand(io), media_settings, clock,
      {.on_bound = [tell](DurationNs) { tell(absl::OkStatus()); },
       .on_frame = [this](transport::ReceivedFrame frame) { on_access_unit(frame); },
       .on_failed =
           [this, tell](const Status& status) {
             tell(status);
             end(status);
           }});
  if (!opened.ok()) return opened.status();
  {
    const std::lock_guard lock(mutex);
    media = *opened;
  }
  return done->get_future().get();
}

Status Connection::Impl::on_frame(FrameType type, std::span<const uint8_t> payload) {
  const TimeNs now = clock.now();
  if (type == FrameType::meta) {
    // A damaged packet over a reliable channel is a broken peer.
    return core->on_meta(payload);
  }
  if (type == FrameType::pong) {
    TESSERA_ASSIGN_OR_RETURN(const transport::ClockPong pong, transport::decode_pong(payload));
    const std::lock_guard lock(mutex);
    offset.on_pong(now, pong);
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("frame of type ", static_cast<int>(type), " is not the server's to send"));
}

void Connection::Impl::on_access_unit(const transport::ReceivedFrame& frame) {
  if (frame.complete) {
    if (const Status status = core->on_atlas(frame.access_unit); !status.ok())
      spdlog::debug("client: {}", status.ToString());
  }
  if (!core->wants_key_frame()) return;
  std::shared_ptr<transport::MediaClient> to;
  {
    const std::lock_guard lock(mutex);
    to = media;
  }
  if (to) to->request_key_frame();
}

void Connection::Impl::ping() {
  if (closing || meta->closed()) return;
  (void)meta->send(FrameType::ping, transport::encode(transport::ClockPing{++ping_id, clock.now()}));
  ping_timer.expires_after(std::chrono::nanoseconds(kPingIntervalNs));
  ping_timer.async_wait([this](transport::SystemError error) {
    if (!error) ping();
  });
}

void Connection::Impl::close() {
  asio::post(io, [this] {
    closing = true;
    ping_timer.cancel();
  });
  if (media) media->close();
  if (meta) meta->close(absl::OkStatus());
}

Connection::Connection(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

StatusOr<std::unique_ptr<Connection>> Connection::connect(const ConnectionSettings& settings,
                                                          const Clock& clock) {
  std::unique_ptr<Connection> connection(new Connection(std::make_unique<Impl>(settings, clock)));
  TESSERA_RETURN_IF_ERROR(connection->impl_->open());
  return connection;
}

Connection::~Connection() {
  impl_->close();
  impl_->work.reset();  // the thread ends when the bye is out, or close_timeout_ns is
  if (impl_->thread.joinable()) impl_->thread.join();
}

void Connection::send_pose(const TimedPose& pose) {
  const transport::SequencedPose sequenced{impl_->pose_sequence++, pose};
  if (!impl_->media->send_pose(sequenced))
    (void)impl_->meta->send(FrameType::pose, transport::encode(sequenced));
}

const Pair* Connection::take_newest() {
  return impl_->core->take_newest();
}

void Connection::report_displayed(FrameNumber frame, TimeNs displayed_ns) {
  const transport::FrameTiming timing{.frame = frame, .displayed = displayed_ns};
  (void)impl_->meta->send(FrameType::timing, transport::encode(std::span(&timing, 1)));
}

Status Connection::status() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->ended;
}

const transport::Welcome& Connection::welcome() const {
  return impl_->welcome;
}

ConnectionStats Connection::stats() const {
  const std::lock_guard lock(impl_->mutex);
  return {impl_->core->stats(), impl_->media->stats(), impl_->media->round_trip_ns(),
          impl_->offset.offset_ns()};
}

}  // namespace tessera::client
