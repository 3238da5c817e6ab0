#include "server/streamed_session.h"

#include <algorithm>
#include <utility>

#include "base/log.h"

namespace tessera::server {
namespace {

using transport::FrameType;

constexpr DurationNs kHistoryNs = kNsPerSecond / 2;       // of poses, for prediction
constexpr DurationNs kFirstRoundTripNs = 100 * kNsPerMs;  // assumed before the client has reported one
constexpr DurationNs kMaxRoundTripNs = kNsPerSecond;
constexpr size_t kMaxFramesInFlight = 256;
constexpr DurationNs kRateWindowNs = kNsPerSecond;

}  // namespace

StreamedSession::StreamedSession(transport::SessionId id, std::shared_ptr<SharedScene> scene,
                                 const SessionSettings& settings, std::shared_ptr<transport::MediaPort> media,
                                 const Clock& clock, OnRendered on_rendered)
    : id_(id),
      media_(std::move(media)),
      clock_(clock),
      settings_(settings),
      on_rendered_(std::move(on_rendered)),
      scene_(std::move(scene)),
      rate_(settings.rate) {
  stats_.round_trip_ns = kFirstRoundTripNs;
}

Status StreamedSession::admit(const transport::ClientSettings& client) {
  const std::lock_guard lock(mutex_);
  if (admitted_) {
    return absl::FailedPreconditionError(
        absl::StrCat("session ", id_, " has a client already; create a session for each client"));
  }
  admitted_ = true;
  client_view_.width = client.width;
  client_view_.height = client.height;
  client_view_.fov = client.fov;
  return absl::OkStatus();
}

void StreamedSession::on_connected(std::shared_ptr<transport::MetaConnection> connection) {
  const std::lock_guard lock(mutex_);
  connection_ = std::move(connection);
}

void StreamedSession::on_closed(const Status& reason) {
  const std::lock_guard lock(mutex_);
  connection_.reset();
  poses_.clear();
  admitted_ = bound_ = false;
  restart_ = true;  // the next client knows nothing
  stats_.ended = reason;
}

void StreamedSession::on_bound() {
  const std::lock_guard lock(mutex_);
  bound_ = true;
}

void StreamedSession::on_pose(const transport::SequencedPose& pose) {
  const std::lock_guard lock(mutex_);
  if (!poses_.empty() && pose.timed.time_ns <= poses_.back().time_ns) return;
  std::erase_if(poses_, [&](const TimedPose& p) { return p.time_ns < pose.timed.time_ns - kHistoryNs; });
  poses_.push_back(pose.timed);
}

void StreamedSession::on_key_frame_request() {
  const std::lock_guard lock(mutex_);
  key_frame_wanted_ = true;
}

Status StreamedSession::on_frame(FrameType type, std::span<const uint8_t> payload) {
  switch (type) {
    case FrameType::pose: {
      TESSERA_ASSIGN_OR_RETURN(const transport::SequencedPose pose, transport::decode_pose(payload));
      on_pose(pose);
      return absl::OkStatus();
    }
    case FrameType::timing:
      return on_timing(payload);
    case FrameType::ping:
      return answer_ping(payload);
    default:
      return absl::InvalidArgumentError(
          absl::StrCat("frame of type ", static_cast<int>(type), " is not the client's to send"));
  }
}

Status StreamedSession::on_timing(std::span<const uint8_t> payload) {
  TESSERA_ASSIGN_OR_RETURN(const std::vector<transport::FrameTiming> timings,
                           transport::decode_timings(payload));
  const std::lock_guard lock(mutex_);
  for (const transport::FrameTiming& timing : timings) {
    const auto pose = pose_of_frame_.find(timing.frame);
    if (pose == pose_of_frame_.end() || timing.displayed <= pose->second) continue;
    // Both times are the client's.
    stats_.round_trip_ns = std::min(timing.displayed - pose->second, kMaxRoundTripNs);
    pose_of_frame_.erase(pose_of_frame_.begin(), std::next(pose));
  }
  return absl::OkStatus();
}

Status StreamedSession::answer_ping(std::span<const uint8_t> payload) {
  const TimeNs received = clock_.now();
  TESSERA_ASSIGN_OR_RETURN(const transport::ClockPing ping, transport::decode_ping(payload));
  std::shared_ptr<transport::MetaConnection> connection;
  {
    const std::lock_guard lock(mutex_);
    connection = connection_;
  }
  if (!connection) return absl::OkStatus();
  return connection->send(FrameType::pong, transport::encode(transport::ClockPong{ping.id, ping.client_sent,
                                                                                  received, clock_.now()}));
}

void StreamedSession::close(const Status& reason) {
  std::shared_ptr<transport::MetaConnection> connection;
  {
    const std::lock_guard lock(mutex_);
    connection = std::exchange(connection_, nullptr);
  }
  if (connection) connection->close(reason);
}

bool StreamedSession::ready() const {
  const std::lock_guard lock(mutex_);
  return connection_ && bound_ && !poses_.empty();
}

TimeNs StreamedSession::due_ns() const {
  const std::lock_guard lock(mutex_);
  return due_ns_;
}

StreamedSession::Work StreamedSession::take_work() {
  const std::lock_guard lock(mutex_);
  if (std::exchange(restart_, false)) session_.reset();
  return {poses_, connection_, client_view_, stats_.round_trip_ns, std::exchange(key_frame_wanted_, false),
          rate_};
}

// Frames keep their rhythm; one that comes too late begins a new one.
void StreamedSession::put_off(bool sent, FrameNumber number, TimeNs pose_ns) {
  const TimeNs now = clock_.now();
  const std::lock_guard lock(mutex_);
  due_ns_ += period_ns();
  if (due_ns_ < now) due_ns_ = now;
  ++(sent ? stats_.frames_sent : stats_.frames_skipped);
  if (!sent) return;
  pose_of_frame_[number] = pose_ns;
  if (pose_of_frame_.size() > kMaxFramesInFlight) pose_of_frame_.erase(pose_of_frame_.begin());
}

void StreamedSession::count(const Frame& frame) {
  const TimeNs now = clock_.now();
  const std::lock_guard lock(mutex_);
  stats_.key_frames += frame.atlas.key_frame ? 1 : 0;
  stats_.meta_bytes += frame.meta.size();
  stats_.encoder = session_->encoder();
  std::erase_if(sent_, [&](const auto& s) { return s.first <= now - kRateWindowNs; });
  sent_.emplace_back(now, frame.meta.size() + frame.atlas.bytes.size());
}

Status StreamedSession::set_rate(double bitrate_bps, double frames_per_second) {
  {
    const std::lock_guard lock(mutex_);
    rate_.bitrate_bps = bitrate_bps;
    rate_.frames_per_second = frames_per_second;
  }
  return media_->set_rate(id_, bitrate_bps);
}

RateSplit StreamedSession::rate() const {
  const std::lock_guard lock(mutex_);
  return rate_;
}

Status StreamedSession::render() {
  Work work = take_work();
  if (!work.connection || work.poses.empty()) return absl::OkStatus();
  if (!session_) {
    SessionSettings settings = settings_;
    settings.client_view = work.client_view;
    settings.rate = work.rate;
    TESSERA_ASSIGN_OR_RETURN(session_, Session::create(scene_, settings));
  }
  session_->set_rate(work.rate);
  TESSERA_ASSIGN_OR_RETURN(
      const double budget,
      media_->frame_budget_bits(id_, from_seconds(1 / work.rate.frames_per_second), work.key_frame));
  if (budget <= 0) {  // frames are dropped before they are encoded, never after
    if (work.key_frame) on_key_frame_request();
    put_off(false, 0, 0);
    return absl::OkStatus();
  }
  const TimeNs start = clock_.now();
  const FrameNumber number = next_frame_++;
  TESSERA_ASSIGN_OR_RETURN(const Frame frame, session_->render({.number = number,
                                                                .poses = work.poses,
                                                                .round_trip_ns = work.round_trip_ns,
                                                                .scene_time_ns = start,
                                                                .key_frame = work.key_frame}));
  put_off(true, number, frame.pose.time_ns);
  count(frame);
  log_event(spdlog::level::debug, "frame rendered",
            {{"session", id_},
             {"frame", number},
             {"key_frame", frame.atlas.key_frame},
             {"atlas_bytes", frame.atlas.bytes.size()},
             {"meta_bytes", frame.meta.size()},
             {"render_ms", frame.stats.times.total_ms()}});
  if (on_rendered_) on_rendered_(frame.stats);
  // A client that left meanwhile is no error of this frame: on_closed() tells.
  if (!work.connection->send(FrameType::meta, frame.meta).ok()) return absl::OkStatus();
  const auto sent = media_->send_frame(id_, start, frame.atlas.bytes, frame.atlas.key_frame);
  if (absl::IsResourceExhausted(sent.status())) {
    on_key_frame_request();
    return absl::OkStatus();
  }
  return sent.status();
}

void StreamedSession::release() {
  session_.reset();
  scene_.reset();
}

StreamedSessionStats StreamedSession::stats() const {
  const std::lock_guard lock(mutex_);
  StreamedSessionStats stats = stats_;
  stats.connected = connection_ != nullptr;
  for (const auto& [when, bytes] : sent_)
    if (when > clock_.now() - kRateWindowNs) stats.bitrate_bps += 8 * static_cast<double>(bytes);
  stats.media = media_->sender_stats(id_).value_or(stats.media);
  stats.peer = media_->peer_report(id_);
  return stats;
}

}  // namespace tessera::server
