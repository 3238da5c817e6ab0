#include "client-sdk/connection.h"

#include <algorithm>
#include <atomic>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/thread_pool.hpp>
#include <future>
#include <mutex>
#include <thread>
#include <utility>

#include "base/log.h"
#include "client-sdk/frame_times.h"
#include "transport/asio/media_client.h"
#include "transport/asio/meta_client.h"
#include "transport/clock_offset.h"

namespace tessera::client {
namespace {

namespace asio = transport::asio;
using transport::FrameType;

// The first pings come fast, for an offset of the clocks before the first picture.
constexpr DurationNs kPingIntervalNs = kNsPerSecond, kFirstPingIntervalNs = 50 * kNsPerMs;
constexpr uint32_t kFirstPings = 8;
// That wait for the decoder. Video beyond it is dropped up to the next key frame, so that a slow decoder
// lowers the rate and not the age of what is shown; metas, which cannot be missed, end the connection.
constexpr size_t kMaxUndecodedAtlases = 4;
constexpr size_t kMaxUndecodedMetaBytes = 32u << 20;
// However long the steps before took, a few hellos are tried.
constexpr DurationNs kMinMediaTimeoutNs = kNsPerSecond;

}  // namespace

struct Connection::Impl {
  Impl(const ConnectionSettings& s, const Clock& c)
      : settings(s), clock(c), work(io.get_executor()), ping_timer(io) {}

  Status open();
  Status open_meta();
  Status open_media();
  void close();
  Status on_frame(FrameType type, std::span<const uint8_t> payload);
  Status on_meta(std::span<const uint8_t> packet);
  void on_access_unit(transport::ReceivedFrame frame);
  void decode_meta(const std::vector<uint8_t>& packet, TimeNs complete);
  void decode_atlas(const transport::ReceivedFrame& frame);
  void note_drawn(FrameNumber frame, TimeNs begin);
  void report(FrameNumber frame, TimeNs displayed);
  void request_key_frame();
  void ping();
  void end(const Status& reason);
  void opened(const Status& status);

  const ConnectionSettings settings;
  const Clock& clock;
  const TimeNs give_up = clock.now() + settings.connect_timeout_ns;  // on connecting
  std::unique_ptr<ClientCore> core;  // once the codec is known, before the first frame
  asio::io_context io{1};            // run by one thread, which never waits for a decoder
  asio::executor_work_guard<asio::io_context::executor_type> work;
  asio::steady_timer ping_timer;
  std::shared_ptr<transport::MetaConnection> meta;  // set once, before the media client opens
  std::shared_ptr<transport::MediaClient> media;
  std::promise<Status> media_opened;  // or the session has ended before
  std::atomic<bool> media_told = false;
  transport::Welcome welcome;
  std::atomic<uint32_t> pose_sequence = 0;
  uint32_t ping_id = 0;  // the receiving thread's, as is
  bool closing = false;
  std::atomic<size_t> undecoded_atlases{0}, undecoded_meta_bytes{0};
  FrameTimes times;  // the decoder's, with the core's receiving side

  mutable std::mutex mutex;  // of all below
  transport::ClockOffset offset;
  Status ended;
  std::thread thread;
  asio::thread_pool decoder{1};  // last: its thread uses all of the above
};

void Connection::Impl::end(const Status& reason) {
  const Status why = reason.ok() ? absl::CancelledError("the server ended the session") : reason;
  {
    const std::lock_guard lock(mutex);
    if (ended.ok()) ended = why;
  }
  opened(why);
}

void Connection::Impl::opened(const Status& status) {
  if (!media_told.exchange(true)) media_opened.set_value(status);
}

Status Connection::Impl::open() {
  thread = std::thread([this] { io.run(); });
  TESSERA_RETURN_IF_ERROR(open_meta());
  TESSERA_RETURN_IF_ERROR(open_media());
  asio::post(io, [this] { ping(); });
  return absl::OkStatus();
}

Status Connection::Impl::open_meta() {
  const auto done = std::make_shared<std::promise<Status>>();
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
      [this, done](StatusOr<std::shared_ptr<transport::MetaConnection>> connection,
                   const transport::Welcome& answer) {
        welcome = answer;
        if (!connection.ok()) return done->set_value(connection.status());
        meta = *connection;  // before its first frame
        auto made = ClientCore::create(answer.codec, answer.atlas_width, answer.atlas_height);
        if (made.ok()) core = *std::move(made);
        done->set_value(made.status());
      });
  return done->get_future().get();
}

Status Connection::Impl::open_media() {
  transport::MediaClientSettings media_settings{
      .server_address = settings.server_address,
      .server_port = welcome.media_port,
      .token = settings.token,
      .srtp = welcome.srtp,
      .bind_timeout_ns = std::max(give_up - clock.now(), kMinMediaTimeoutNs)};
  media_settings.receiver.codec = welcome.codec;
  media_settings.receiver.payload_type = welcome.stream.payload_type;
  media_settings.receiver.rtx_payload_type = welcome.stream.rtx_payload_type;
  media_settings.receiver.ssrc = welcome.stream.ssrc;
  media_settings.receiver.rtx_ssrc = welcome.stream.rtx_ssrc;
  media_settings.receiver.first_sequence = welcome.stream.first_sequence;
  auto client = transport::MediaClient::open(
      asio::make_strand(io), media_settings, clock,
      {.on_bound = [this](DurationNs) { opened(absl::OkStatus()); },
       .on_frame = [this](transport::ReceivedFrame frame) { on_access_unit(std::move(frame)); },
       .on_failed = [this](const Status& status) { end(status); }});
  if (!client.ok()) return client.status();
  {
    const std::lock_guard lock(mutex);
    media = *client;
  }
  return media_opened.get_future().get();
}

Status Connection::Impl::on_frame(FrameType type, std::span<const uint8_t> payload) {
  const TimeNs now = clock.now();
  if (!core) return absl::CancelledError("this client has no decoder");
  if (type == FrameType::meta) return on_meta(payload);
  if (type == FrameType::pong) {
    TESSERA_ASSIGN_OR_RETURN(const transport::ClockPong pong, transport::decode_pong(payload));
    const std::lock_guard lock(mutex);
    offset.on_pong(now, pong);
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("frame of type ", static_cast<int>(type), " is not the server's to send"));
}

Status Connection::Impl::on_meta(std::span<const uint8_t> packet) {
  if (undecoded_meta_bytes + packet.size() > kMaxUndecodedMetaBytes) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "this client decodes too slowly: ", kMaxUndecodedMetaBytes >> 20, " MiB of geometry wait"));
  }
  undecoded_meta_bytes += packet.size();
  asio::post(decoder, [this, complete = clock.now(), copy = std::vector(packet.begin(), packet.end())] {
    decode_meta(copy, complete);
    undecoded_meta_bytes -= copy.size();
  });
  return absl::OkStatus();
}

void Connection::Impl::decode_meta(const std::vector<uint8_t>& packet, TimeNs complete) {
  const TimeNs begin = clock.now();
  const StatusOr<FrameNumber> frame = core->on_meta(packet);
  if (!frame.ok()) {  // a damaged packet over a reliable channel is a broken peer
    end(frame.status());
    meta->close(frame.status());
    return;
  }
  ClientFrameTimes& t = times.of(*frame);
  t.meta_complete = complete;
  t.meta_decode_begin = begin;
  t.meta_decoded = clock.now();
}

void Connection::Impl::on_access_unit(transport::ReceivedFrame frame) {
  // The decoder sees by the units' references that one is missing.
  if (!frame.complete || undecoded_atlases >= kMaxUndecodedAtlases) return request_key_frame();
  ++undecoded_atlases;
  asio::post(decoder, [this, frame = std::move(frame)] {
    decode_atlas(frame);
    --undecoded_atlases;
  });
}

void Connection::Impl::decode_atlas(const transport::ReceivedFrame& received) {
  const TimeNs begin = clock.now();
  const StatusOr<FrameNumber> frame = core->on_atlas(received.access_unit);
  if (core->wants_key_frame()) request_key_frame();
  if (!frame.ok()) {
    spdlog::debug("client: {}", frame.status().ToString());
    return;
  }
  ClientFrameTimes& t = times.of(*frame);
  t.atlas_first_packet = received.first_packet_ns;
  t.atlas_complete = received.last_packet_ns;
  t.atlas_decode_begin = begin;
  t.atlas_decoded = clock.now();
}

void Connection::Impl::request_key_frame() {
  std::shared_ptr<transport::MediaClient> to;
  {
    const std::lock_guard lock(mutex);
    to = media;
  }
  if (to) to->request_key_frame();
}

// A drawing thread may take a pair before its decoder has looked at the clock.
void Connection::Impl::note_drawn(FrameNumber frame, TimeNs begin) {
  ClientFrameTimes& t = times.of(frame);
  t.draw_begin = std::max({begin, t.atlas_decoded, t.meta_decoded});
}

void Connection::Impl::report(FrameNumber frame, TimeNs displayed) {
  std::vector<ClientFrameTimes> taken = times.take_up_to(frame);
  std::optional<DurationNs> clock_offset, round_trip;
  {
    const std::lock_guard lock(mutex);
    clock_offset = offset.offset_ns();
    round_trip = offset.round_trip_ns();
  }
  for (ClientFrameTimes& t : taken) {
    if (t.frame == frame) t.displayed = displayed;
    t.clock_offset = clock_offset.value_or(0);
    t.clock_error = clock_offset ? *round_trip / 2 : -1;
  }
  if (!taken.empty()) (void)meta->send(FrameType::timing, transport::encode(taken));
}

void Connection::Impl::ping() {
  if (closing || meta->closed()) return;
  (void)meta->send(FrameType::ping, transport::encode(transport::ClockPing{++ping_id, clock.now()}));
  ping_timer.expires_after(
      std::chrono::nanoseconds(ping_id < kFirstPings ? kFirstPingIntervalNs : kPingIntervalNs));
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
  impl_->decoder.stop();  // what waits for it is of no use any more
  impl_->decoder.join();
}

void Connection::send_pose(const TimedPose& pose, const std::optional<vec3>& gaze) {
  const transport::SequencedPose sequenced{impl_->pose_sequence++, pose, impl_->clock.now(), gaze};
  if (!impl_->media->send_pose(sequenced))
    (void)impl_->meta->send(FrameType::pose, transport::encode(sequenced));
}

const Pair* Connection::take_newest() {
  const Pair* pair = impl_->core->take_newest();
  if (!pair) return nullptr;
  // Behind what the decoder still has to note of this frame.
  asio::post(impl_->decoder, [impl = impl_.get(), frame = pair->frame, begin = impl_->clock.now()] {
    impl->note_drawn(frame, begin);
  });
  return pair;
}

void Connection::report_displayed(FrameNumber frame, TimeNs displayed_ns) {
  asio::post(impl_->decoder,
             [impl = impl_.get(), frame, displayed_ns] { impl->report(frame, displayed_ns); });
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
